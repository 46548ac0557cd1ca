// "Did you mean …?"
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace pliant {

/// The candidate that was meant by name: the only one that begins with it, else the only one with a word (between
/// underscores) that does ("width" for "hopper_width"; a single letter takes the shortest); else the one with the
/// fewest typing errors (a letter too many, missing, wrong, or two swapped), at most a third of the name's length. Case
/// counts nothing. Nothing if none is near.
std::optional<std::string> nearest(std::string_view name, std::span<const std::string> candidates);

}  // namespace pliant
