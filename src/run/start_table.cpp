#include <pliant/run/start_table.h>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include <pliant/base/errors.h>
#include <pliant/base/text.h>
#include <pliant/model/polygon.h>

namespace pliant {
namespace {

constexpr std::size_t largest_table = std::size_t{1} << 30;  ///< bytes
constexpr std::string_view column_separators = ",; \t\r";

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  std::size_t at = line.find_first_not_of(column_separators);
  while (at != line.npos) {
    const std::size_t end = std::min(line.find_first_of(column_separators, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(column_separators, end);
  }
  return words;
}

std::optional<Real> number_of(std::string_view word) {
  Real value = 0;
  if (word.starts_with('+')) word.remove_prefix(1);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) return {};
  return value;
}

/// Columns of numbers, checked as far as they do not depend on each other.
class Table {
 public:
  Table(const std::string& file, const std::vector<std::string>& needed, const std::vector<std::string>& known)
      : file_(printable(file)) {
    const std::string text = read_text_file(file, largest_table, "table");
    std::string_view rest = text;
    for (int line = 1; !rest.empty(); ++line) {
      const std::size_t end = std::min(rest.find('\n'), rest.size());
      const std::string_view content = rest.substr(0, end);
      rest.remove_prefix(std::min(end + 1, rest.size()));
      const std::vector<std::string_view> words = words_of(content.substr(0, content.find('#')));
      if (words.empty()) continue;
      if (names_.empty())
        read_names(words, line, needed, known);
      else
        read_row(words, line);
    }
    if (names_.empty())
      throw InputError("{}: is empty; write a line with the names of the columns ({}), and a row for each particle",
                       file_, fmt::join(needed, ","));
    if (lines_.empty()) throw InputError("{}: has no rows below the names of the columns", file_);
  }

  std::size_t rows() const { return lines_.size(); }
  bool has(const std::string& name) const { return std::ranges::find(names_, name) != names_.end(); }
  Real at(std::size_t row, const std::string& name) const { return values_[row * names_.size() + column(name)]; }
  Real positive(std::size_t row, const std::string& name) const {
    const Real value = at(row, name);
    if (!(value > 0)) refuse(row, "{} is {:g}, but must be positive", name, value);
    return value;
  }
  std::int64_t number(std::size_t row, const std::string& name) const {
    const Real value = at(row, name);
    if (!(value >= 0 && value < 2147483647 && value == std::floor(value)))
      refuse(row, "{} is {:g}, but must be a whole number from 0", name, value);
    return static_cast<std::int64_t>(value);
  }
  template <class... Args>
  [[noreturn]] void refuse(std::size_t row, fmt::format_string<Args...> text, Args&&... args) const {
    throw InputError("{}:{}: {}", file_, lines_[row], fmt::format(text, std::forward<Args>(args)...));
  }
  int line(std::size_t row) const { return lines_[row]; }
  const std::string& file() const { return file_; }

 private:
  std::size_t column(const std::string& name) const {
    return static_cast<std::size_t>(std::ranges::find(names_, name) - names_.begin());
  }

  void read_names(const std::vector<std::string_view>& words, int line, const std::vector<std::string>& needed,
                  const std::vector<std::string>& known) {
    if (number_of(words[0]))
      throw InputError("{}:{}: \"{}\" is not a name of a column; begin the table with a line of names, for example {}",
                       file_, line, printable(words[0]), fmt::join(needed, ","));
    for (const std::string_view word : words) {
      std::string name(word);
      if (std::ranges::find(known, name) == known.end())
        throw InputError("{}:{}: column {} is unknown here; the columns are {}; leave it out", file_, line,
                         printable(name), fmt::join(known, ", "));
      if (has(name)) throw InputError("{}:{}: there are two columns {}; leave one out", file_, line, name);
      names_.push_back(std::move(name));
    }
    const auto need = [&](const std::string& name, std::string_view why) {
      if (!has(name)) throw InputError("{}:{}: column {} is missing{}", file_, line, name, why);
    };
    for (const std::string& name : needed) need(name, fmt::format("; a table needs {}", fmt::join(needed, ", ")));
    for (const std::string& name : known)
      if (name.size() == 2 && name[0] == 'v' && (has("vx") || has("vy") || has("vz")))
        need(name, "; give all components of the velocity, or none");
  }

  void read_row(const std::vector<std::string_view>& words, int line) {
    if (words.size() != names_.size())
      throw InputError("{}:{}: {} values in a table of {} columns ({})", file_, line, words.size(), names_.size(),
                       fmt::join(names_, ","));
    lines_.push_back(line);
    for (std::size_t k = 0; k < words.size(); ++k) {
      const std::optional<Real> value = number_of(words[k]);
      if (!value || !std::isfinite(*value))
        throw InputError("{}:{}: {} is \"{}\", which is not a finite number", file_, line, names_[k],
                         printable(words[k]));
      values_.push_back(*value);
    }
  }

  std::string file_;
  std::vector<std::string> names_;
  std::vector<Real> values_;  ///< [rows · columns]
  std::vector<int> lines_;    ///< line number of each row
};

const std::vector<std::string>& axes(int dim) {
  static const std::vector<std::string> plane{"x", "y"}, space{"x", "y", "z"};
  return dim == 2 ? plane : space;
}

/// Appends position and velocity of a row.
void add_point(const Table& table, std::size_t row, int dim, StartParticles& to) {
  for (const std::string& axis : axes(dim)) to.x.push_back(table.at(row, axis));
  if (!table.has("vx")) return;
  for (const std::string& axis : axes(dim)) to.v.push_back(table.at(row, "v" + axis));
}

StartParticles read_points(const std::string& file, const StartNeeds& needs) {
  const int dim = needs.dim;
  std::vector<std::string> needed = axes(dim), known{"id"};
  needed.emplace_back("diameter");
  known.insert(known.end(), needed.begin(), needed.end());
  known.emplace_back("mass");
  for (const std::string& axis : axes(dim)) known.push_back("v" + axis);
  if (dim == 2 && needs.rotates) known.insert(known.end(), {"angle", "spin"});
  const Table table(file, needed, known);
  std::vector<std::size_t> order;
  for (std::size_t row = 0; row < table.rows(); ++row) order.push_back(row);
  if (table.has("id")) {
    std::map<std::int64_t, std::size_t> by_id;
    for (const std::size_t row : order)
      if (const auto [other, fresh] = by_id.emplace(table.number(row, "id"), row); !fresh)
        table.refuse(row, "id {} is also in line {}; each particle needs a different id", other->first,
                     table.line(other->second));
    order.clear();
    for (const auto& [id, row] : by_id) order.push_back(row);
  }
  StartParticles all;
  all.topology.dim = dim;
  all.has_masses = table.has("mass");
  for (const std::size_t row : order) {
    const Real sigma = table.positive(row, "diameter");
    const Real volume = dim == 2 ? pi * square(sigma) / 4 : pi * sigma * square(sigma) / 6;
    all.topology.add_soft(sigma, table.has("mass") ? table.positive(row, "mass") : needs.density * volume);
    add_point(table, row, dim, all);
    if (table.has("angle")) all.angles.push_back(table.at(row, "angle"));
    if (table.has("spin")) all.spins.push_back(table.at(row, "spin"));
  }
  return all;
}

StartParticles read_polygons(const std::string& file, const StartNeeds& needs) {
  const std::vector<std::string> needed{"particle", "vertex", "x", "y"};
  std::vector<std::string> known = needed;
  known.insert(known.end(), {"vx", "vy", "diameter", "a0", "l0", "mass"});
  const Table table(file, needed, known);
  std::map<std::int64_t, std::map<std::int64_t, std::size_t>> rows;  // of each particle, in the order of its vertices
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::int64_t m = table.number(row, "particle");
    const auto [other, fresh] = rows[m].emplace(table.number(row, "vertex"), row);
    if (!fresh)
      table.refuse(row, "vertex {} of particle {} is also in line {}", other->first, m, table.line(other->second));
  }
  StartParticles all;
  all.has_widths = table.has("diameter");
  for (const auto& [m, vertices] : rows) {
    const std::size_t first = vertices.begin()->second;
    if (vertices.size() < 3) table.refuse(first, "particle {} has {} vertices; give at least 3", m, vertices.size());
    for (const char* name : {"diameter", "a0", "l0", "mass"})
      for (const auto& [vertex, row] : vertices)
        if (table.has(name) && table.at(row, name) != table.at(first, name))
          table.refuse(row, "{} of particle {} is {:g}, but {:g} in line {}; a particle has one", name, m,
                       table.at(row, name), table.at(first, name), table.line(first));
    const auto n = static_cast<Index>(vertices.size());
    for (const auto& [vertex, row] : vertices) add_point(table, row, 2, all);
    // The shape in the table is the shape at rest unless the table has another.
    Topology shape;
    shape.add_polygon(n, 1, 1, 1, 1);
    const Real* const x = &all.x[static_cast<std::size_t>(all.topology.points()) * 2];
    if (const auto fault = outline_fault(shape, 0, x)) table.refuse(first, "particle {}: {}", m, *fault);
    const auto value = [&](const char* name, Real otherwise) {
      return table.has(name) ? table.positive(first, name) : otherwise;
    };
    const Real a0 = value("a0", polygon_area(x, shape, 0)), l0 = value("l0", polygon_perimeter(x, shape, 0) / n);
    all.topology.add_polygon(n, a0, l0, value("diameter", needs.edge_width.value_or(1) * l0),
                             value("mass", needs.density * a0));
  }
  return all;
}

}  // namespace

StartParticles read_start_table(const std::string& file, const StartNeeds& needs) {
  return needs.polygons ? read_polygons(file, needs) : read_points(file, needs);
}

}  // namespace pliant
