// Sizes of the disks in a channel [T table 3.1].
#pragma once

#include <string>
#include <vector>

#include <pliant/base/types.h>

namespace pliant {

/// Disks of one radius: cm, and how many of them there are relative to the other sizes.
struct SizeClass {
  Real radius, count;
};

/// bidisperse, T1, T2a … T4, C1 … C3.
const std::vector<std::string>& size_distribution_names();
/// Sizes of [T table 3.1], the largest first, in multiples of a = 0.3175 cm. The numbers of C1, C2 and C3 are printed
/// in a figure only: the numbers of the smallest and the largest disks are the table's, and between them the numbers
/// follow a power law of the radius. Errors: InputError for an unknown name.
std::vector<SizeClass> size_distribution(const std::string& name);

/// Sizes of two lists of numbers, "0.635,0.9525" (cm) and "1,1". Errors: InputError, which names the options -radii and
/// -counts.
std::vector<SizeClass> parse_sizes(const std::string& radii, const std::string& counts);

/// The numbers of disks of each size that cover `area` (cm²): the nearest integers to a multiple of the distribution's
/// numbers. Rare sizes come first, and more frequent sizes compensate their rounding, so that the area is right to half
/// a set of the most frequent sizes. Errors: InputError if the area is too small for a disk.
std::vector<Index> disks_for_area(const std::vector<SizeClass>& sizes, Real area);

/// Area covered by these numbers of disks of these sizes, in cm².
Real covered_area(const std::vector<SizeClass>& sizes, const std::vector<Index>& disks);
/// δ = √⟨(R − ⟨R⟩)²⟩/⟨R⟩ with these relative numbers; [T 3.1] prints the root over ⟨R⟩ too.
Real polydispersity(const std::vector<SizeClass>& sizes);

}  // namespace pliant
