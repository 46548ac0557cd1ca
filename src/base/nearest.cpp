#include <pliant/base/nearest.h>

#include <algorithm>
#include <cctype>
#include <vector>

namespace pliant {
namespace {

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(), [](unsigned char c) { return std::tolower(c); });
  return result;
}

// Optimal string alignment: Levenshtein's distance in which a swap of neighbours counts once.
std::size_t typing_errors(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

}  // namespace

std::optional<std::string> nearest(std::string_view name, std::span<const std::string> candidates) {
  constexpr std::size_t longest = 100;  // nobody mistypes so much; keeps the table small
  if (name.empty() || name.size() > longest) return {};
  const std::string wanted = lower(name);

  const std::string* best = nullptr;
  std::size_t best_errors = std::max<std::size_t>(1, std::min<std::size_t>(3, wanted.size() / 3)) + 1;
  for (const auto& candidate : candidates) {
    if (const auto errors = typing_errors(wanted, lower(candidate)); errors < best_errors) {
      best = &candidate;
      best_errors = errors;
    }
  }
  if (best != nullptr) return *best;

  const auto is_part = [&](const std::string& candidate) {
    const std::string whole = lower(candidate);
    return wanted.size() > 1 && (whole.starts_with(wanted + "_") || whole.ends_with("_" + wanted));
  };
  const auto first = std::find_if(candidates.begin(), candidates.end(), is_part);
  if (first == candidates.end() || std::any_of(first + 1, candidates.end(), is_part)) return {};
  return *first;
}

}  // namespace pliant
