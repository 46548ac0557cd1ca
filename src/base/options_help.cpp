// The texts that describe the options: -help and the reference in Markdown.
#include <fmt/format.h>
#include <pliant/base/options.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <iterator>

namespace pliant {
namespace {

std::string cell(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '|') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

/// pliant-sweep reads it too.
const char* restart_text(OnRestart policy) {
  switch (policy) {
    case OnRestart::keep:
      return "may change";
    case OnRestart::fixed:
      return "fixed";
    case OnRestart::forget:
      return "not kept";
  }
  return "";
}

/// Explains marks like [H 8] and [T 2.5]; empty if the text has no such mark.
std::string key_of_equations(const std::string& text) {
  if (text.find("[H ") == std::string::npos && text.find("[T ") == std::string::npos) return "";
  return "[H n] and [T n.m] are equations of the two publications that docs/README.md names.\n";
}

}  // namespace

std::string Options::type_text(const Option& option) {
  if (!option.spec.choices.empty()) return fmt::format("{}", fmt::join(option.spec.choices, "|"));
  constexpr const char* names[] = {"real", "real", "integer", "integer", "yes|no", "text", "choice"};
  static_assert(std::size(names) == std::variant_size_v<Target>);
  return names[option.target.index()];
}

std::string Options::range_text(const Option& option) {
  const OptionSpec& spec = option.spec;
  std::string text;
  if (std::isfinite(spec.min)) text = fmt::format("{} {}", spec.min_open ? ">" : "≥", spec.min);
  if (std::isfinite(spec.max))
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", spec.max_open ? "<" : "≤", spec.max);
  return text;
}

std::string Options::default_text(const Option& option) {
  const auto& value = option.default_value;
  if (value.is_null()) return option.spec.automatic.empty() ? "none" : option.spec.automatic;
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  if (value.is_number_float()) return fmt::format("{}", value.get<Real>());
  if (value.is_string()) return value.get<std::string>().empty() ? "none" : value.get<std::string>();
  return value.dump();
}

// Groups in the order of their first option.
std::vector<Options::Group> Options::by_group() const {
  std::vector<Group> groups;
  for (const Option& option : options_) {
    auto group = std::find_if(groups.begin(), groups.end(), [&](const auto& g) { return g.first == option.group; });
    if (group == groups.end()) group = groups.insert(groups.end(), {option.group, {}});
    group->second.push_back(&option);
  }
  return groups;
}

std::string Options::help_line(const Option& option) {
  std::string facts = option.spec.unit;
  const auto add = [&](const std::string& fact) {
    if (!fact.empty()) facts += (facts.empty() ? "" : "; ") + fact;
  };
  add("default " + default_text(option));
  add(range_text(option));
  add(option.spec.only_with);
  return fmt::format("  {:<34}  {} [{}]\n", fmt::format("-{} <{}>", option.name, type_text(option)), option.spec.help,
                     facts);
}

std::string Options::help(const std::string& group) const {
  const std::vector<Group> groups = by_group();
  std::vector<std::string> titles;
  for (const Group& g : groups) titles.push_back(g.first);
  const auto print = [](const Group& g) {
    std::string text = g.first + ":\n";
    for (const Option* option : g.second) text += help_line(*option);
    return text;
  };
  if (!group.empty()) {
    const auto found = std::find_if(titles.begin(), titles.end(), [&](const std::string& title) {
      return title.size() >= group.size() && std::equal(group.begin(), group.end(), title.begin(), [](char a, char b) {
               return std::tolower(static_cast<unsigned char>(a)) == std::tolower(static_cast<unsigned char>(b));
             });
    });
    if (found == titles.end())
      throw InputError("-help {}: there is no such group; the groups are {}", group, fmt::join(titles, ", "));
    std::string text = print(groups[static_cast<std::size_t>(found - titles.begin())]);
    if (const std::string key = key_of_equations(text); !key.empty()) text += '\n' + key;
    return text;
  }
  std::string text;
  if (!most_used_.empty()) {
    text = "Most used:\n";
    for (const std::string& name : most_used_) text += help_line(*find(name));
    text += '\n';
  }
  text += fmt::format("Groups, shown alone by -help GROUP: {}\n\n", fmt::join(titles, ", "));
  for (const Group& g : groups) text += print(g) + '\n';
  text +=
      "Everywhere:\n"
      "  -options_file <file>                options from a file: YAML or lines of -name value; may be repeated\n"
      "  -help (or -h), -version             print this, or the version, and stop\n"
      "PETSc's own options (-ts_type, -snes_rtol, -ksp_view, -log_view …) are passed on to PETSc.\n";
  return text + key_of_equations(text);
}

std::string Options::markdown() const {
  std::string text;
  const auto out = std::back_inserter(text);
  for (const auto& [title, members] : by_group()) {
    fmt::format_to(
        out,
        "{}## {}\n\n| option | type | default | unit | range | on restart | meaning |\n|---|---|---|---|---|---|---|\n",
        text.empty() ? "" : "\n", title);
    for (const Option* option : members) {
      const std::string& only = option->spec.only_with;
      fmt::format_to(out, "| `-{}` | {} | {} | {} | {} | {} | {} |\n", option->name, cell(type_text(*option)),
                     cell(default_text(*option)), option->spec.unit, range_text(*option),
                     restart_text(option->spec.on_restart),
                     cell(only.empty() ? option->spec.help : fmt::format("{} ({})", option->spec.help, only)));
    }
  }
  return text;
}

nlohmann::ordered_json Options::table() const {
  auto result = nlohmann::ordered_json::array();
  for (const auto& [title, members] : by_group())
    for (const Option* option : members)
      result.push_back({{"name", option->name},
                        {"group", title},
                        {"help", option->spec.help},
                        {"type", option->spec.choices.empty() ? type_text(*option) : "choice"},
                        {"default", option->default_value},
                        {"default_text", default_text(*option)},
                        {"unit", option->spec.unit},
                        {"range", range_text(*option)},
                        {"choices", option->spec.choices},
                        {"on_restart", restart_text(option->spec.on_restart)}});
  return result;
}

}  // namespace pliant
