// "Did you mean …?"
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace pliant {

/// The candidate nearest to name: the smallest number of typing errors (a letter too many, missing, wrong, or two
/// swapped; case counts nothing), at most a third of the name's length; else the only candidate that has the name as
/// its beginning or end ("width" for "hopper_width"). Nothing if none is near.
std::optional<std::string> nearest(std::string_view name, std::span<const std::string> candidates);

}  // namespace pliant
