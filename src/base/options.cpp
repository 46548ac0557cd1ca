#include <pliant/base/nearest.h>
#include <pliant/base/options.h>
#include <pliant/base/petsc.h>
#include <pliant/base/text.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <string_view>

namespace pliant {
namespace {

using Json = nlohmann::json;

// Families of PETSc's options, by prefix. Not here: options that PETSc reads only while it starts (malloc_, fp_trap,
// on_error_ …), and options that draw in windows.
constexpr std::array<std::string_view, 16> petsc_families{"ts_",  "snes_",   "ksp_",   "pc_",        "mat_", "vec_",
                                                          "dm_",  "is_",     "sf_",    "tao_",       "mg_",  "sub_",
                                                          "npc_", "viewer_", "inner_", "fieldsplit_"};
// Flags that PETSc reads during the run or when it ends, so that check_consumed sees them unused. PETSc would report a
// bad value only at the end.
constexpr std::array<std::string_view, 6> petsc_flags{"memory_view", "options_view",    "options_left",
                                                      "citations",   "get_total_flops", "info"};
// The same with a value or without.
constexpr std::array<std::string_view, 3> petsc_later{"log_view", "snes_test_jacobian", "snes_test_jacobian_view"};
// Ends of names of options that PETSc would ignore without a value.
constexpr std::array<std::string_view, 19> petsc_valued{"_type",       "_rtol",      "_atol",   "_stol",   "_divtol",
                                                        "_dt",         "_dt_min",    "_dt_max", "_max_it", "_max_steps",
                                                        "_max_reject", "_max_funcs", "_clip",   "_safety", "_order",
                                                        "_restart",    "_levels",    "_radius", "_theta"};
// Options that are mistyped most often; PETSc has no list of its options.
constexpr std::array<std::string_view, 74> petsc_usual{"ts_type",
                                                       "ts_dt",
                                                       "ts_max_time",
                                                       "ts_max_steps",
                                                       "ts_max_reject",
                                                       "ts_rtol",
                                                       "ts_atol",
                                                       "ts_monitor",
                                                       "ts_monitor_solution",
                                                       "ts_view",
                                                       "ts_exact_final_time",
                                                       "ts_adapt_type",
                                                       "ts_adapt_dt_min",
                                                       "ts_adapt_dt_max",
                                                       "ts_adapt_clip",
                                                       "ts_adapt_safety",
                                                       "ts_adapt_monitor",
                                                       "ts_adapt_always_accept",
                                                       "ts_adapt_wnormtype",
                                                       "ts_adapt_dsp_filter",
                                                       "ts_rk_type",
                                                       "ts_arkimex_type",
                                                       "ts_rosw_type",
                                                       "ts_bdf_order",
                                                       "ts_theta_theta",
                                                       "ts_alpha_radius",
                                                       "ts_max_snes_failures",
                                                       "ts_error_if_step_fails",
                                                       "snes_type",
                                                       "snes_rtol",
                                                       "snes_atol",
                                                       "snes_stol",
                                                       "snes_max_it",
                                                       "snes_max_funcs",
                                                       "snes_monitor",
                                                       "snes_view",
                                                       "snes_converged_reason",
                                                       "snes_linesearch_type",
                                                       "snes_lag_jacobian",
                                                       "snes_lag_preconditioner",
                                                       "snes_mf",
                                                       "snes_mf_operator",
                                                       "snes_fd",
                                                       "snes_fd_color",
                                                       "snes_test_jacobian",
                                                       "ksp_type",
                                                       "ksp_rtol",
                                                       "ksp_atol",
                                                       "ksp_max_it",
                                                       "ksp_monitor",
                                                       "ksp_view",
                                                       "ksp_converged_reason",
                                                       "ksp_gmres_restart",
                                                       "ksp_norm_type",
                                                       "ksp_pc_side",
                                                       "pc_type",
                                                       "pc_factor_levels",
                                                       "pc_factor_mat_ordering_type",
                                                       "pc_factor_shift_type",
                                                       "pc_view",
                                                       "tao_type",
                                                       "tao_monitor",
                                                       "tao_view",
                                                       "tao_converged_reason",
                                                       "mat_type",
                                                       "mat_view",
                                                       "vec_type",
                                                       "vec_view",
                                                       "log_view",
                                                       "memory_view",
                                                       "options_view",
                                                       "options_left",
                                                       "citations",
                                                       "get_total_flops"};
// Handled before everything else.
constexpr std::array<std::string_view, 4> reserved{"help", "h", "version", "options_file"};

template <class Array>
bool contains(const Array& array, std::string_view name) {
  return std::find(array.begin(), array.end(), name) != array.end();
}

[[noreturn]] void bad_value(const Setting& setting, const std::string& why) {
  throw InputError("{}: {}", setting.text(), why);
}

std::string did_you_mean(const std::optional<std::string>& name) {
  return name ? fmt::format("; did you mean {}?", *name) : "";
}

// Whether a help text has the symbol of a quantity: "width w of the orifice".
bool has_word(const std::string& help, const std::string& symbol) {
  return symbol != "a" && (' ' + help + ' ').find(' ' + symbol + ' ') != std::string::npos;
}

std::string_view without_plus(std::string_view text) {
  return text.size() > 1 && text[0] == '+' && text[1] != '-' ? text.substr(1) : text;
}

// The text as a number; nothing if it is not a number, infinite or NaN.
std::optional<Real> finite_number(const Setting& setting) {
  const std::string_view text = without_plus(*setting.value);
  Real result = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), result);
  if (error == std::errc::result_out_of_range) bad_value(setting, "too large or too small for a double");
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(result)) return {};
  return result;
}

Real parse_real(const Setting& setting) {
  const auto number = finite_number(setting);
  if (!number) bad_value(setting, "not a finite number");
  return *number;
}

std::int64_t parse_integer(const Setting& setting, std::int64_t smallest, std::int64_t largest) {
  const std::string_view text = without_plus(*setting.value);
  std::int64_t result = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), result);
  bool fits = error == std::errc();
  if (error == std::errc::invalid_argument || end != text.data() + text.size()) {  // 1e6
    const auto number = finite_number(setting);
    if (!number || *number != std::trunc(*number)) bad_value(setting, "not an integer");
    constexpr Real exact = 9007199254740992;  // 2^53: beyond, a double does not hold every integer
    fits = std::abs(*number) <= exact;
    if (fits) result = static_cast<std::int64_t>(*number);
  }
  if (!fits || result < smallest || result > largest)
    bad_value(setting, fmt::format("is out of range: integers must be between {} and {}", smallest, largest));
  return result;
}

bool parse_bool(const Setting& setting) {
  if (!setting.value) return true;
  std::string text = *setting.value;
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  if (contains(std::array<std::string_view, 4>{"true", "yes", "on", "1"}, text)) return true;
  if (contains(std::array<std::string_view, 4>{"false", "no", "off", "0"}, text)) return false;
  bad_value(setting, "not a yes or no; use true, false, yes, no, on, off, 1 or 0");
}

std::size_t parse_choice(const Setting& setting, const std::vector<std::string>& choices) {
  const auto found = std::find(choices.begin(), choices.end(), *setting.value);
  if (found == choices.end())
    bad_value(setting, fmt::format("must be one of {}{}", fmt::join(choices, ", "),
                                   did_you_mean(nearest(*setting.value, choices))));
  return static_cast<std::size_t>(found - choices.begin());
}

std::string range_of(const OptionSpec& spec) {
  std::string text;
  if (std::isfinite(spec.min)) text = fmt::format("{} {}", spec.min_open ? "greater than" : "at least", spec.min);
  if (std::isfinite(spec.max))
    text += fmt::format("{}{} {}", text.empty() ? "" : " and ", spec.max_open ? "less than" : "at most", spec.max);
  return text;
}

bool in_range(Real a, const OptionSpec& spec) {
  return (spec.min_open ? a > spec.min : a >= spec.min) && (spec.max_open ? a < spec.max : a <= spec.max);
}

template <class Number>
Number checked(const Setting& setting, Number a, const OptionSpec& spec) {
  if (!in_range(static_cast<Real>(a), spec))
    bad_value(setting, fmt::format("must be {}{}", range_of(spec),
                                   spec.unit.empty() ? "" : fmt::format(" (unit {})", spec.unit)));
  return a;
}

// Options that PETSc would ignore, or report at the end.
void check_petsc(const Setting& setting) {
  const auto ends = [&](std::string_view end) { return setting.name.ends_with(end); };
  if (!setting.value && std::any_of(petsc_valued.begin(), petsc_valued.end(), ends))
    bad_value(setting, "needs a value");
  if (!setting.value) return;
  if (contains(petsc_flags, setting.name)) bad_value(setting, "takes no value here");
  if (setting.value->starts_with("draw")) bad_value(setting, "a run cannot open windows");
  for (const std::string_view format : {"ascii_xml", "ascii_flamegraph"})
    if (setting.name == "log_view" && setting.value->ends_with(format))
      bad_value(setting, "PETSc crashes in this format; leave it out, or use ascii_csv");
}

// Whether -log_view can be written to its file; PETSc opens the file only at the end.
void check_log_view(const Setting& setting) {
  PetscViewer viewer = nullptr;
  try {
    petsc_check(PetscOptionsGetViewer(PETSC_COMM_WORLD, nullptr, nullptr, "-log_view", &viewer, nullptr, nullptr));
  } catch (const Error& error) {
    petsc_check(PetscOptionsClearValue(nullptr, "-log_view"));
    bad_value(setting, error.what());
  }
  petsc_check(PetscViewerDestroy(&viewer));
}

std::string plain(const Json& value) { return value.is_string() ? value.get<std::string>() : value.dump(); }

template <class... F>
struct Overload : F... {
  using F::operator()...;
};
template <class... F>
Overload(F...) -> Overload<F...>;

}  // namespace

std::string path_from(const std::filesystem::path& folder, const std::string& path) { return (folder / path).string(); }

void Options::group(std::string title) { group_ = std::move(title); }

void Options::bind(const std::string& name, Real& target, OptionSpec spec) { add(name, &target, std::move(spec)); }
void Options::bind(const std::string& name, std::optional<Real>& target, OptionSpec spec) {
  add(name, &target, std::move(spec));
}
void Options::bind(const std::string& name, Index& target, OptionSpec spec) { add(name, &target, std::move(spec)); }
void Options::bind(const std::string& name, std::int64_t& target, OptionSpec spec) {
  add(name, &target, std::move(spec));
}
void Options::bind(const std::string& name, bool& target, OptionSpec spec) { add(name, &target, std::move(spec)); }
void Options::bind(const std::string& name, std::string& target, OptionSpec spec) {
  add(name, &target, std::move(spec));
}

void Options::add(const std::string& name, Target target, OptionSpec spec) {
  if (find(name) != nullptr || contains(reserved, name))
    throw std::logic_error("option -" + name + " is declared twice");
  Option option{name, group_, std::move(spec), std::move(target)};
  if (const auto* e = std::get_if<Enumeration>(&option.target); e != nullptr && e->get() >= option.spec.choices.size())
    throw std::logic_error("option -" + name + ": its default is none of its choices");
  option.default_value = value(option);
  try {
    assign(option, option.default_value, "default");
  } catch (const InputError& error) {
    throw std::logic_error(std::string("the default of an option is not allowed: ") + error.what());
  }
  options_.push_back(std::move(option));
}

void Options::most_used(std::vector<std::string> names) {
  for (const std::string& name : names)
    if (find(name) == nullptr) throw std::logic_error("-" + name + " is no option");
  most_used_ = std::move(names);
}

void Options::accept_petsc_prefix(std::string prefix) { prefixes_.push_back(std::move(prefix)); }

Options::Request Options::parse(const std::vector<std::string>& arguments) {
  std::vector<Setting> settings, from_arguments;
  Request request = Request::run;
  for (Setting& setting : read_arguments(arguments)) {
    if (setting.name == "help" || setting.name == "h") {
      request = Request::help;
      help_group_ = setting.value.value_or("");
    }
    if (setting.name == "version" && request == Request::run) request = Request::version;
    from_arguments.push_back(std::move(setting));
  }
  if (request != Request::run) return request;

  for (Setting& setting : from_arguments) {
    if (setting.name != "options_file") continue;
    if (!setting.value || setting.value->empty()) throw InputError("-options_file: needs the name of a file");
    for (Setting& entry : read_options_file(*setting.value))
      if (!entry.group || find(entry.name) != nullptr) settings.push_back(std::move(entry));  // not of an empty group
  }
  std::erase_if(from_arguments, [](const Setting& setting) { return setting.name == "options_file"; });
  std::move(from_arguments.begin(), from_arguments.end(), std::back_inserter(settings));
  for (const Setting& setting : settings) refuse_unknown(setting);

  given_.clear();
  for (Setting& setting : settings) given_[setting.name] = std::move(setting);
  reset();
  return request;
}

void Options::reset() {
  petsc_check(PetscOptionsClear(nullptr));
  petsc_.clear();
  for (Option& option : options_) assign(option, option.default_value, "default");
  for (const auto& [name, setting] : given_) {
    if (Option* option = find(name)) assign(*option, setting);
    insert_petsc(setting);
  }
}

// Sets the bound variable from the text that the user gave.
void Options::assign(Option& option, const Setting& setting, bool stored) {
  const OptionSpec& spec = option.spec;
  if (!setting.value && (setting.null || !std::holds_alternative<bool*>(option.target)))
    bad_value(setting, fmt::format("needs a value ({})", type_text(option)));
  constexpr auto int64_min = std::numeric_limits<std::int64_t>::min(),
                 int64_max = std::numeric_limits<std::int64_t>::max();
  std::visit(Overload{[&](Real* target) { *target = checked(setting, parse_real(setting), spec); },
                      [&](std::optional<Real>* target) { *target = checked(setting, parse_real(setting), spec); },
                      [&](Index* target) {
                        const auto number = parse_integer(setting, std::numeric_limits<Index>::min(),
                                                          std::numeric_limits<Index>::max());
                        *target = static_cast<Index>(checked(setting, number, spec));
                      },
                      [&](std::int64_t* target) {
                        *target = checked(setting, parse_integer(setting, int64_min, int64_max), spec);
                      },
                      [&](bool* target) { *target = parse_bool(setting); },
                      [&](std::string* target) {
                        if (!spec.choices.empty()) parse_choice(setting, spec.choices);
                        if (setting.value->empty() && !stored) bad_value(setting, "is empty");
                        *target = spec.read && !stored ? spec.read(*setting.value, setting.folder()) : *setting.value;
                      },
                      [&](const Enumeration& target) { target.set(parse_choice(setting, spec.choices)); }},
             option.target);
  option.source = setting.source;
}

// The same from a value of `json()`.
void Options::assign(Option& option, const Json& value, const std::string& source) {
  if (auto* target = std::get_if<std::optional<Real>*>(&option.target); target != nullptr && value.is_null()) {
    **target = std::nullopt;
    option.source = source;
  } else if (value.is_null()) {
    throw InputError("-{}: the stored value is missing", option.name);
  } else {
    assign(option, Setting{option.name, plain(value), source}, true);
  }
}

Json Options::value(const Option& option) {
  return std::visit(Overload{[](const std::optional<Real>* target) { return *target ? Json(**target) : Json(); },
                             [&](const Enumeration& target) { return Json(option.spec.choices[target.get()]); },
                             [](const auto* target) { return Json(*target); }},
                    option.target);
}

std::string Options::curing(Cure cure) const {
  for (const Option& option : options_) {
    if (option.spec.term && !option.spec.term()) continue;
    const auto found = std::ranges::find(option.spec.cures, cure, &OptionCure::cure);
    if (found != option.spec.cures.end())
      return found->value.empty() ? option.name : fmt::format("{} {}", option.name, found->value);
  }
  return "";
}

std::string Options::extending(std::string_view ended_by) const {
  for (const Option& option : options_)
    if (const auto& [by, value] = option.spec.extends; !by.empty() && by == ended_by)
      return fmt::format("{} {}", option.name, value);
  return "";
}

const Options::Option* Options::find(const std::string& name) const {
  const auto found =
      std::find_if(options_.begin(), options_.end(), [&](const Option& option) { return option.name == name; });
  return found == options_.end() ? nullptr : &*found;
}

Options::Option* Options::find(const std::string& name) {
  return const_cast<Option*>(std::as_const(*this).find(name));  // NOLINT: one search for both
}

bool Options::is_petsc(const std::string& name) const {
  const auto begins = [&](std::string_view prefix) { return name.starts_with(prefix); };
  const auto has = [&](std::string_view part) { return name.find(part) != name.npos; };
  if (has("_lg") || has("draw") || has("monitor_sp_") || has("_plot_")) return false;  // a run has no windows
  if (has("swarm") || has("rhs_jacobian_test")) return false;  // PETSc crashes without a swarm, or without a matrix
  return contains(petsc_flags, name) || contains(petsc_later, name) ||
         std::any_of(petsc_families.begin(), petsc_families.end(), begins) ||
         std::any_of(prefixes_.begin(), prefixes_.end(), begins);
}

void Options::refuse_unknown(const Setting& setting) const {
  if (setting.name == "help" || setting.name == "h" || setting.name == "version")
    throw InputError("{}: belongs on the command line, not in a file", setting.text());
  const auto known = [&](const std::string& name) { return find(name) != nullptr || is_petsc(name); };
  if (known(setting.name)) return;
  const std::string where = setting.line > 0 ? fmt::format(" ({}:{})", setting.source, setting.line) : "";
  if (const auto equals = setting.name.find('='); equals != std::string::npos && known(setting.name.substr(0, equals)))
    throw InputError("unknown option -{}{}; write -{} {}", setting.name, where, setting.name.substr(0, equals),
                     setting.name.substr(equals + 1));
  if (const auto unit = units_.find(setting.name); unit != units_.end())
    throw InputError("unknown option -{}{}; {}", setting.name, where, unit->second);
  std::vector<std::string> names(reserved.begin(), reserved.end());
  for (const Option& option : options_) names.push_back(option.name);
  names.insert(names.end(), petsc_usual.begin(), petsc_usual.end());
  const auto has_symbol = [&](const Option& option) { return has_word(option.spec.help, setting.name); };
  const auto named =
      setting.name.size() == 1 ? std::find_if(options_.begin(), options_.end(), has_symbol) : options_.end();
  const auto near = named != options_.end() ? std::optional(named->name) : nearest(setting.name, names);
  throw InputError("unknown option -{}{}; {}", setting.name, where,
                   near ? fmt::format("did you mean -{}?", *near) : "-help lists all options");
}

// All options go into the PETSc database, for -options_view; options of pliant are marked as used.
void Options::insert_petsc(const Setting& setting) {
  const std::string name = "-" + setting.name;
  if (find(setting.name) == nullptr) check_petsc(setting);
  petsc_check(PetscOptionsSetValue(nullptr, name.c_str(), setting.value ? setting.value->c_str() : nullptr));
  if (find(setting.name) != nullptr) {
    PetscBool used = PETSC_FALSE;
    petsc_check(PetscOptionsHasName(nullptr, nullptr, name.c_str(), &used));
    return;
  }
  petsc_[setting.name] = setting;
  // PETSc reads these while it starts, which is over.
  if (setting.name == "log_view") {
    check_log_view(setting);
    petsc_check(PetscLogDefaultBegin());
  }
  if (setting.name == "memory_view") petsc_check(PetscMemorySetGetMaximumUsage());
  if (setting.name == "info") {
    petsc_check(PetscInfoSetFile(nullptr, "w"));  // to the standard output
    petsc_check(PetscInfoAllow(PETSC_TRUE));
  }
}

void Options::from_json(const Json& stored) {
  if (!stored.is_object()) throw InputError("stored options are damaged: not a JSON object");
  for (const auto& [name, entry] : stored.items()) {
    if (!entry.is_object() || !entry.contains("value"))
      throw InputError("stored options are damaged: {} has no value", name);
    const Json& old = entry["value"];
    if (Option* option = find(name)) {
      const OnRestart policy = option->spec.on_restart;
      if (policy == OnRestart::forget) continue;
      if (option->source == "default") {
        assign(*option, old, "restart");
      } else if (policy == OnRestart::fixed) {
        const Json now = value(*option);
        assign(*option, old, option->source);
        if (value(*option) != now)
          throw RestartConflict(
              "-{} {}: the stored run has {}, and a restart cannot change it; leave it out, or start a new run in "
              "another folder",
              name, printable(plain(now)), old.is_null() ? std::string("an automatic value") : printable(plain(old)));
      }
    } else if (!is_petsc(name)) {
      throw InputError("stored options: -{} is unknown to this version; continue with the version that wrote them",
                       name);
    } else if (!petsc_.contains(name)) {
      insert_petsc({name, old.is_null() ? std::nullopt : std::optional(plain(old)), "restart"});
    }
  }
}

void Options::check_consumed(std::string_view solvers) const {
  PetscInt count = 0;
  char **names = nullptr, **values = nullptr;
  petsc_check(PetscOptionsLeftGet(nullptr, &count, &names, &values));
  const std::vector<std::string> left(names, names + count);
  petsc_check(PetscOptionsLeftRestore(nullptr, &count, &names, &values));
  for (const std::string& name : left) {
    const auto found = petsc_.find(name);
    if (found == petsc_.end() || contains(petsc_flags, name) || contains(petsc_later, name)) continue;
    const std::vector<std::string> usual(petsc_usual.begin(), petsc_usual.end());
    auto near = nearest(name, usual);
    if (near == name) near.reset();
    const bool of_solver = std::ranges::any_of(petsc_families, [&](auto prefix) { return name.starts_with(prefix); });
    throw InputError("option {} has no effect; {}", found->second.text(),
                     near                            ? fmt::format("did you mean -{}?", *near)
                     : of_solver && !solvers.empty() ? std::string(solvers)
                                                     : "it is misspelt, or the chosen solver does not read it");
  }
}

const std::string& Options::source(const std::string& name) const {
  if (const Option* option = find(name)) return option->source;
  throw std::logic_error("option -" + name + " is not declared");
}

namespace {

std::string unit_of(const OptionSpec& spec) { return spec.unit_of_run ? spec.unit_of_run() : spec.unit; }
Json default_of(const auto& option) {
  return option.spec.default_of_run ? Json(option.spec.default_of_run()) : option.default_value;
}

}  // namespace

Json Options::reference() const {
  Json result = Json::object();
  for (const Option& option : options_) {
    const OptionSpec& spec = option.spec;
    Json& entry = result[option.name] = {{"default", default_of(option)}, {"unit", unit_of(spec)}};
    if (!spec.symbol.empty()) entry["symbol"] = spec.symbol;
    if (spec.term) entry["models"] = spec.models;
  }
  return result;
}

Json Options::json() const {
  Json result = Json::object();
  for (const Option& option : options_) {
    const OptionSpec& spec = option.spec;
    Json entry = {{"value", value(option)}, {"unit", unit_of(spec)}, {"source", option.source}};
    entry["is_default"] = option.source == "default" || entry["value"] == default_of(option);
    if (!option.spec.symbol.empty()) entry["symbol"] = option.spec.symbol;
    if (option.spec.term) {
      const std::optional<std::string> term = option.spec.term();
      entry["term"] = term ? Json(*term) : Json();
    }
    result[option.name] = std::move(entry);
  }
  for (const auto& [name, setting] : petsc_)
    result[name] = {{"value", setting.value ? Json(*setting.value) : Json()}, {"unit", ""}, {"source", setting.source}};
  return result;
}

}  // namespace pliant
