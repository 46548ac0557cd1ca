// Polylines as users write them: outlines of containers.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

inline constexpr std::size_t largest_outline = std::size_t{8} << 20;  ///< bytes of such a file

/// A polyline, and the line numbers of its points in the file.
struct Polyline {
  std::vector<Vec<2>> points;
  std::vector<int> lines;
};

/// The numbers of a text with these separators; nothing if the text contains anything else.
std::optional<std::vector<Real>> parse_numbers(std::string_view text, std::string_view separators);

/// The points of a text: lines "x y", a blank line between polylines, # begins a comment. name, unit: of the file and
/// of its numbers, for messages. Errors: InputError with file and line.
std::vector<Polyline> parse_polylines(std::string_view text, const std::string& name, std::string_view unit);

/// Whether two segments cross each other in their insides.
bool cross_each_other(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, const Vec<2>& d);

/// The polygon with these corners, counterclockwise; the last corner may repeat the first. Errors: InputError for fewer
/// than three corners, a side of length 0, sides that cross, or an area of 0.
std::vector<Vec<2>> make_polygon(std::vector<Vec<2>> corners);

}  // namespace pliant
