// "Did you mean …?"
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace pliant {

/// The candidate that was probably meant by name: the only candidate that begins with name, else the only candidate
/// with a word (between underscores) that does ("width" for "hopper_width"; a single letter selects the shortest). Else
/// the candidate with the fewest typing errors (a letter too many, missing, wrong, or two swapped), at most a third of
/// the name's length. Case is ignored. Nothing if no candidate is near.
std::optional<std::string> nearest(std::string_view name, std::span<const std::string> candidates);

}  // namespace pliant
