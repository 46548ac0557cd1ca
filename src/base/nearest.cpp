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

enum class Abbreviates { name, later_word, nothing };

// A single letter abbreviates words that are longer: w is width, not the w of e_w.
Abbreviates what_begins_with(const std::string& part, const std::string& name) {
  if (name.starts_with(part)) return Abbreviates::name;
  const std::string word = "_" + part;
  for (auto at = name.find(word); at != name.npos; at = name.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    if (part.size() > 1 || (end < name.size() && name[end] != '_')) return Abbreviates::later_word;
  }
  return Abbreviates::nothing;
}

// The only candidate that begins with the part, else the only candidate with a later word that does. If a single letter
// abbreviates several candidates, the first of the shortest.
const std::string* abbreviated(const std::string& part, std::span<const std::string> candidates) {
  for (const Abbreviates what : {Abbreviates::name, Abbreviates::later_word}) {
    const std::string* found = nullptr;
    std::size_t count = 0;
    for (const std::string& candidate : candidates) {
      if (what_begins_with(part, lower(candidate)) != what) continue;
      if (count++ == 0 || candidate.size() < found->size()) found = &candidate;
    }
    if (count == 1 || (count > 1 && part.size() == 1)) return found;
  }
  return nullptr;
}

}  // namespace

std::optional<std::string> nearest(std::string_view name, std::span<const std::string> candidates) {
  constexpr std::size_t longest = 100;  // longer than any misspelt name; limits the table
  if (name.empty() || name.size() > longest) return {};
  const std::string wanted = lower(name);

  if (const auto* whole = abbreviated(wanted, candidates)) return *whole;
  if (wanted.size() == 1) return {};  // a single letter would match every name with one error
  const std::string* best = nullptr;
  std::size_t best_errors = std::max<std::size_t>(1, std::min<std::size_t>(3, wanted.size() / 3)) + 1;
  for (const auto& candidate : candidates) {
    if (const auto errors = typing_errors(wanted, lower(candidate)); errors < best_errors) {
      best = &candidate;
      best_errors = errors;
    }
  }
  return best != nullptr ? std::optional(*best) : std::nullopt;
}

}  // namespace pliant
