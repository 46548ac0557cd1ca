#include <pliant/run/ensemble.h>

#include <fmt/format.h>
#include <malloc.h>
#include <omp.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <deque>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string_view>
#include <utility>

#include <pliant/base/console.h>
#include <pliant/base/version.h>
#include <pliant/io/atomic_file.h>
#include <pliant/io/ensemble_file.h>
#include <pliant/io/folder_lock.h>
#include <pliant/io/message_log.h>
#include <pliant/io/summary.h>
#include <pliant/run/folder.h>
#include <pliant/run/run_control.h>
#include <pliant/run/start_particles.h>
#include <pliant/run/worker.h>

namespace pliant {
namespace {

using Json = nlohmann::ordered_json;

/// The option that differs between members, and its values as texts; no values without one.
struct Varied {
  std::string option;
  std::vector<std::string> values;
};

/// The same text, or the same number.
bool same_value(const std::string& a, const std::string& b) {
  const auto number = [](const std::string& text) -> std::optional<Real> {
    Real value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc() && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
  };
  return a == b || (number(a) && number(a) == number(b));
}

Varied varied_option(const RunOptions& p, const Options& options) {
  if (p.ensemble_over.empty()) return {};
  const std::size_t equals = p.ensemble_over.find('=');
  Varied varied{p.ensemble_over.substr(0, equals), {}};
  if (varied.option.starts_with('-')) varied.option.erase(0, 1);
  const auto refuse = [&](std::string_view why) {
    throw InputError("-ensemble_over {}: {}; give an option and its values, as in t_end=1,2,3", p.ensemble_over, why);
  };
  if (equals == std::string::npos) refuse("there are no values");
  const std::string values = p.ensemble_over.substr(equals + 1);
  for (std::size_t at = 0; at <= values.size();) {
    const std::size_t comma = std::min(values.find(',', at), values.size());
    varied.values.push_back(values.substr(at, comma - at));
    if (varied.values.back().empty()) refuse("a value is empty");
    at = comma + 1;
  }
  for (const std::string_view own :
       {"seed", "output", "restart", "ensemble", "ensemble_over", "ensemble_workers", "threads", "max_wall_time"})
    if (varied.option == own) refuse("the ensemble sets this option");
  if (options.declared(varied.option) && options.given(varied.option))
    refuse(fmt::format("-{} is given too", varied.option));
  for (const std::string& a : varied.values)
    for (const std::string& b : std::span(varied.values.data(), &a))
      if (same_value(a, b)) refuse(a == b ? "a value is there twice" : fmt::format("{} and {} are one value", b, a));
  return varied;
}

constexpr const char* start_crc32 = "start_crc32";  ///< entry of a description

/// Settings that may differ where an ensemble continues.
bool may_change(const std::string& option) {
  static const std::set<std::string> free{
      "output",        "restart",          "ensemble",          "max_wall_time",
      "ensemble_over", "ensemble_workers", "progress_interval", "checkpoint_interval"};
  return free.contains(option);
}

/// The description of an ensemble, for readers and for a repetition of the command.
Json description(const std::string& scenario, const RunOptions& p, const Options& options, const Varied& varied) {
  Json values = Json::object();
  const nlohmann::json settings = options.json();
  for (const auto& [name, option] : settings.items())
    if (!may_change(name)) values[name] = option["value"];
  Json all{{"scenario", scenario},    {"members_of_a_value", p.ensemble}, {"first_seed", p.seed},
           {"option", varied.option}, {"values", varied.values},          {"options", std::move(values)}};
  // Options contain the name of this file only.
  if (options.declared("start") && options.given("start"))
    if (const auto crc = crc32_of_start(settings["start"]["value"].get<std::string>())) all[start_crc32] = *crc;
  return all;
}

/// Of logged results: this program, and an ensemble with these settings and any number of members.
std::string owner_of(Json description) {
  description.erase("members_of_a_value");
  return description.dump() + build_info().build();
}

/// Errors: InputError where the folder holds an ensemble with other settings.
void check_same(const Json& stored, const Json& wanted, const std::string& folder) {
  const auto refuse = [&](const std::string& name, const Json& there, const Json& here) {
    throw InputError("{} holds an ensemble with {} {}, not {}; give the same options, or choose another -output",
                     folder, name, there.dump(), here.dump());
  };
  for (const char* name : {"scenario", "option", "values"})
    if (stored.value(name, Json()) != wanted[name]) refuse(name, stored.value(name, Json()), wanted[name]);
  if (stored.contains(start_crc32) && stored[start_crc32] != wanted.value(start_crc32, Json()))
    throw InputError(
        "{} holds an ensemble whose file -start {} had other contents; restore them, or choose another -output", folder,
        wanted["options"].value("start", ""));
  const Json there = stored.value("options", Json::object());
  for (const auto& [name, value] : wanted["options"].items())
    if (there.value(name, Json()) != value) refuse("-" + name, there.value(name, Json()), value);
}

/// The outcome of a member.
class Result {
 public:
  /// As a worker sends it. kept: the part of the summary from which means and tables are made. summary: JSON text.
  /// objects: a message with the content of run.h5 (io/recording.h), which is the largest part, and is not copied.
  static std::string bytes(ExitCode code, const std::string& message, const Json& kept, const std::string& summary,
                           std::string&& objects) {
    const std::array<std::uint64_t, 2> sizes{objects.size(), summary.size()};
    return std::move(objects)
        .append(summary)
        .append(Json{{"code", static_cast<int>(code)}, {"message", message}, {"kept", kept}}.dump())
        .append(reinterpret_cast<const char*>(sizes.data()), sizeof sizes);
  }
  explicit Result(std::string&& bytes) : bytes_(std::move(bytes)) {
    const std::size_t end = bytes_.size() - sizeof sizes_;
    std::memcpy(sizes_.data(), bytes_.data() + end, sizeof sizes_);
    Json rest = Json::parse(std::string_view(bytes_).substr(0, end).substr(sizes_[0] + sizes_[1]));
    code = static_cast<ExitCode>(rest["code"].get<int>());
    message = rest["message"];
    kept = std::move(rest["kept"]);
  }

  /// Whether the same run would end so again.
  bool has_ended() const { return code == ExitCode::done || code == ExitCode::numerical_failure; }
  std::string_view bytes() const { return bytes_; }
  std::string_view objects() const { return bytes().substr(0, sizes_[0]); }
  std::string summary() const { return bytes_.substr(sizes_[0], sizes_[1]); }

  ExitCode code = ExitCode::done;
  std::string message;
  Json kept;

 private:
  std::string bytes_;
  std::array<std::uint64_t, 2> sizes_{};
};

/// Collects the warnings of a member, and drops its remarks.
class Quiet final : public ConsoleSink, public RunMonitor {
 public:
  void say(std::string_view /*text*/) noexcept override {}
  void warn(std::string_view text) noexcept override {
    try {
      warnings.emplace_back(text);
    } catch (...) {  // no memory for the text
    }
  }
  void progress(Real /*t*/, Real /*end*/, const std::string& /*text*/) override {}
  bool stop() override { return false; }

  std::vector<std::string> warnings;
};

/// The value of a result: a number, or a quantity with a value. NaN for any other value.
Real number_of(const Json& value) {
  constexpr Real none = std::numeric_limits<Real>::quiet_NaN();
  if (value.is_number()) return value.get<Real>();
  if (value.is_object() && value.contains("value") && value["value"].is_number()) return value["value"].get<Real>();
  return none;
}

/// Whether the flow of a result has ended: the result is an average over the flow and the rest after it.
bool is_without_flow(const Json& value) {
  const std::string reason = value.is_object() ? value.value("no_error", "") : "";
  return reason == no_flow::clogged || reason == no_flow::at_rest;
}

/// Mean and standard error over members.
struct Mean {
  std::vector<Real> values;
  std::string unit;

  Json json() const {
    const auto n = static_cast<Real>(values.size());
    // Relative to the first value: then equal values have no error at all.
    Real mean = 0, squares = 0;
    for (const Real v : values) mean += (v - values.front()) / n;
    for (const Real v : values) squares += square(v - values.front() - mean);
    Json q = quantity(values.front() + mean, std::sqrt(squares / (n * (n - 1))), unit);
    if (unit.empty()) q.erase("unit");
    q["members"] = values.size();
    return q;
  }
};

std::string csv_cell(std::string text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  for (std::size_t at = 0; (at = text.find('"', at)) != std::string::npos; at += 2) text.insert(at, 1, '"');
  return '"' + text + '"';
}

class Ensemble {
 public:
  Ensemble(const std::string& scenario, const RunOptions& p, const Options& options, const Ranks& ranks,
           const RunMember& run)
      : scenario_(scenario),
        p_(p),
        options_(options),
        run_(run),
        varied_(varied_option(p, options)),
        description_(description(scenario, p, options, varied_)),
        log_(std::filesystem::path(p.output) / "ensemble.log", owner_of(description_)),
        control_(0, p.max_wall_time, ranks, p.progress_interval),
        workers_(p.ensemble_workers > 0 ? p.ensemble_workers : omp_get_num_procs()),
        count_(p.ensemble * static_cast<Index>(std::max<std::size_t>(varied_.values.size(), 1))) {}

  ExitCode run() {
    const StopSignals signals;
    if (RunMonitor* const monitor = RunMonitor::current()) monitor->begin(p_.output);
    const FolderLock lock(p_.output);
    if (!lock.warning().empty()) warn("{}", lock.warning());
    take_stored();
    say("{}: {} runs{}, {} at a time; output in {}\n", scenario_, count_,
        varied_.values.empty() ? std::string() : fmt::format(", {} for each -{}", p_.ensemble, varied_.option),
        workers_, p_.output);
    if (!done_.empty()) say("{} of them are done\n", done_.size());
    const bool stopped = run_members();
    control_.end_progress();
    return finish(stopped);
  }

 private:
  /// Members of one value follow each other; all values have the same seeds.
  std::int64_t seed_of(Index member) const { return p_.seed + member % p_.ensemble; }
  std::string value_of(Index member) const {
    return varied_.values.empty() ? "" : varied_.values[static_cast<std::size_t>(member / p_.ensemble)];
  }
  std::string name_of(Index member) const {
    std::string name = fmt::format("seed {}", seed_of(member));
    return varied_.values.empty() ? name : fmt::format("-{} {}, {}", varied_.option, value_of(member), name);
  }

  /// Members that earlier processes have stored.
  void take_stored() {
    std::error_code none;
    if (has_checkpoint(p_.output) || std::filesystem::exists(std::filesystem::path(p_.output) / "run.h5", none))
      throw InputError("{} holds a single run; choose another -output", p_.output);
    std::optional<EnsembleFile> found = EnsembleFile::open(p_.output);
    if (!found) return;
    file_.emplace(*std::move(found));
    check_same(file_->ensemble(), description_, p_.output);
    const Index former = file_->ensemble().value("members_of_a_value", Index{0});
    if (former != p_.ensemble && !varied_.values.empty())
      throw InputError(
          "{} holds an ensemble with -ensemble {}, not {}; give the same number, or choose another -output", p_.output,
          former, p_.ensemble);
    if (former > p_.ensemble)
      throw InputError("{} holds an ensemble with -ensemble {}, which is more than {}; give at least as many",
                       p_.output, former, p_.ensemble);
    for (StoredMember& member : file_->members()) done_.emplace(member.number, std::move(member.summary));
    if (former != p_.ensemble) file_->describe(description_);
    for (MessageLog::Message& message : log_.messages())
      if (const auto member = static_cast<Index>(message.number); !done_.contains(member))
        store(member, Result(std::move(message.bytes)));
    flush();
  }

  /// The bytes of a Result. warnings: the texts of its warnings.
  std::string result_of(Index member, ExitCode code, const std::string& message,
                        const std::vector<std::string>& warnings, MemberOutput&& output) const {
    Json summary = std::move(output.summary);
    if (!summary.is_object()) summary = {{"status", "failed"}, {"message", message}};
    summary["seed"] = seed_of(member);
    // A result may have the name of the option, as the pressure of a packing has.
    if (!varied_.values.empty() && !summary.contains(varied_.option)) summary[varied_.option] = value_of(member);
    summary["results"] = output.results;
    summary["warnings"] = warnings;
    Json kept = Json::object();
    for (const char* name : {"status", "message", "results", "warnings"})
      if (summary.contains(name)) kept[name] = summary[name];
    for (const std::string& name : output.results) kept[name] = summary[name];
    return Result::bytes(code, message, kept, summary.dump(), std::move(output.objects));
  }

  /// The bytes of a Result, in a worker.
  std::string make(Index member) const {
    Quiet quiet;
    MemberOutput output;
    ExitCode code = ExitCode::done;
    std::string message;
    try {
      std::vector<std::string> more{"-seed", std::to_string(seed_of(member))};
      if (!varied_.values.empty()) more.insert(more.end(), {"-" + varied_.option, value_of(member)});
      code = run_(more, output);
    } catch (...) {
      const Error error = error_in_flight();
      code = error.code();
      message = error.what();
    }
    return result_of(member, code, message, quiet.warnings, std::move(output));
  }

  /// Returns whether it was stopped.
  bool run_members() {
    std::vector<Index> left;
    for (Index member = 0; member < count_; ++member)
      if (!done_.contains(member)) left.push_back(member);
    std::reverse(left.begin(), left.end());
    if (!left.empty())
      for (const char* name : {"members.csv", "summary.json"}) {  // their means are means of fewer runs
        std::error_code ignored;
        std::filesystem::remove(std::filesystem::path(p_.output) / name, ignored);
      }
    const auto make = [this](Index member) { return this->make(member); };
    std::vector<Worker> workers;
    const std::size_t at_start = done_.size();
    // A worker of short runs has its next runs before it has finished the last, and does not wait for this process.
    const auto supply = [&](Worker& worker) {
      constexpr Real ahead = 0.1;  // s
      const Real rate = static_cast<Real>(done_.size() - at_start) / std::max(control_.wall_seconds(), ahead);
      const std::size_t most = 1 + static_cast<std::size_t>(ahead * rate / static_cast<Real>(workers_));
      for (; worker.tasks().size() < most && !left.empty(); left.pop_back()) worker.add(left.back());
    };
    while (workers.size() < static_cast<std::size_t>(workers_) && !left.empty()) {
      workers.emplace_back(make);
      supply(workers.back());
    }
    while (!workers.empty()) {
      if (control_.stop()) {
        workers.clear();
        flush();
        return true;
      }
      std::vector<pollfd> wait;
      for (const Worker& worker : workers) wait.push_back({worker.result_descriptor(), POLLIN, 0});
      constexpr int patience = 200;  // ms
      if (::poll(wait.data(), wait.size(), patience) <= 0) {
        flush();
        show_progress(at_start);
        continue;
      }
      for (std::size_t k = workers.size(); k-- > 0;) {
        if (wait[k].revents == 0) continue;
        const std::deque<Index> tasks = workers[k].tasks();
        auto bytes = workers[k].result();
        std::string death;
        if (!bytes) {
          death = fmt::format("the process of this run {}", workers[k].death());
          left.insert(left.end(), tasks.rbegin(), tasks.rend() - 1);  // the worker had not begun the others
          if (!left.empty()) workers[k] = Worker(make);
        }
        supply(workers[k]);  // the worker computes while this process writes
        if (workers[k].tasks().empty()) workers.erase(workers.begin() + static_cast<std::ptrdiff_t>(k));
        take(tasks.front(),
             Result(bytes ? *std::move(bytes) : result_of(tasks.front(), ExitCode::numerical_failure, death, {}, {})));
      }
      constexpr Real often = 0.5;  // s
      if (control_.wall_seconds() - flushed_at_ > often) flush();
      show_progress(at_start);
    }
    flush();
    return done_.size() < static_cast<std::size_t>(count_);  // a signal may have stopped a worker alone
  }

  void take(Index member, Result&& result) {
    // A run that was stopped by a signal to all processes is not done.
    if (result.code == ExitCode::stopped) return;
    // Bad input of one member ends the ensemble, and so do a full disk or memory, which the user can mend.
    if (!result.has_ended()) {
      flush();
      throw Error(result.code, fmt::format("{}: {}", name_of(member), result.message));
    }
    if (!file_) file_.emplace(EnsembleFile::create(p_.output, description_));
    log_.add(member, result.bytes());
    store(member, std::move(result));
  }

  void store(Index member, Result&& result) {
    file_->add(member, result.summary(), result.objects());
    done_.emplace(member, std::move(result.kept));
    unflushed_ = true;
  }

  void flush() {
    flushed_at_ = control_.wall_seconds();
    if (std::exchange(unflushed_, false)) file_->flush();
    log_.clear();
  }

  void show_progress(std::size_t at_start) {
    const auto all = static_cast<Real>(count_), now = static_cast<Real>(done_.size());
    control_.progress(now, all, [&] {
      const Real rate = (now - static_cast<Real>(at_start)) / control_.wall_seconds();
      return fmt::format("{}/{} runs  {:.3g} runs/s  ETA {}", done_.size(), count_, rate,
                         rate > 0 ? duration_text((all - now) / rate) : "unknown");
    });
  }

  ExitCode finish(bool stopped) {
    if (file_) file_->close();
    log_.remove();
    if (stopped) {
      say("stopped with {} of {} runs done; run the same command again to resume\n", done_.size(), count_);
      return ExitCode::stopped;
    }
    std::map<std::string, std::size_t> warnings;
    std::vector<Index> failed;
    for (const auto& [member, summary] : done_) {
      if (summary.value("status", "") == "failed") failed.push_back(member);
      for (const auto& text : std::set<std::string>(summary["warnings"].begin(), summary["warnings"].end()))
        ++warnings[text];
    }
    for (const auto& [text, members] : warnings) warn("{} of {} runs: {}", members, count_, text);
    write_table();
    write_results(failed);
    if (failed.empty()) return ExitCode::done;
    throw NumericalError(
        "{} of {} runs have failed, the first with {}: {}; members.csv in {} lists the failed runs, and the "
        "means are over the other runs",
        failed.size(), count_, name_of(failed.front()), done_.at(failed.front()).value("message", "without a message"),
        p_.output);
  }

  /// Names of the results, in the order of the first member that has them.
  std::vector<std::string> result_names() const {
    std::vector<std::string> names;
    for (const auto& [member, summary] : done_)
      for (const std::string name : summary["results"])
        if (std::find(names.begin(), names.end(), name) == names.end() &&
            (summary[name].is_number() || (summary[name].is_object() && summary[name].contains("value"))))
          names.push_back(name);
    return names;
  }

  void write_table() const {
    const std::vector<std::string> names = result_names();
    std::string text = "member,seed";
    if (!varied_.values.empty()) text.append(",").append(csv_cell(varied_.option));
    text += ",status";
    for (const std::string& name : names)
      text.append(",").append(csv_cell(name == varied_.option ? name + "_result" : name));
    text += ",message\n";
    for (const auto& [member, summary] : done_) {
      text += fmt::format("{},{}", member, seed_of(member));
      if (!varied_.values.empty()) text.append(",").append(csv_cell(value_of(member)));
      text.append(",").append(summary.value("status", ""));
      for (const std::string& name : names) {
        const Real value = summary.contains(name) ? number_of(summary[name]) : number_of({});
        text += std::isfinite(value) ? fmt::format(",{}", value) : ",";
      }
      text.append(",").append(csv_cell(summary.value("message", ""))).append("\n");
    }
    write_file_atomically(std::filesystem::path(p_.output) / "members.csv", {text});
  }

  /// Means over the members of a value that have not failed.
  Json results_of(std::size_t value) const {
    Json group = Json::object();
    if (!varied_.values.empty()) group[varied_.option] = varied_.values[value];
    Index whole = 0;
    std::map<std::string, Index> statuses;
    std::map<std::string, Mean> means;
    const auto first = static_cast<Index>(value) * p_.ensemble;
    for (Index member = first; member < first + p_.ensemble; ++member) {
      const Json& summary = done_.at(member);
      const std::string status = summary.value("status", "");
      ++statuses[status];
      if (status == "failed") continue;
      ++whole;
      for (const std::string name : summary["results"]) {
        if (is_without_flow(summary[name])) continue;
        const Real number = number_of(summary[name]);
        if (!std::isfinite(number)) continue;
        means[name].values.push_back(number);
        if (summary[name].is_object() && summary[name].value("unit", Json()).is_string())
          means[name].unit = summary[name]["unit"];
      }
    }
    group["members"] = whole;
    group["statuses"] = statuses;
    group["results"] = Json::object();
    for (const std::string& name : result_names())
      if (const auto mean = means.find(name); mean != means.end()) group["results"][name] = mean->second.json();
    return group;
  }

  void write_results(const std::vector<Index>& failed) const {
    Json s = summary_head(scenario_, "", failed.empty() ? "done" : "failed", "ensemble", options_);
    s.erase("model");
    s["members"] = count_;
    s["failed"] = failed.size();
    s["wall_seconds"] = control_.wall_seconds();
    Json groups = Json::array();
    for (std::size_t value = 0; value < std::max<std::size_t>(varied_.values.size(), 1); ++value)
      groups.push_back(results_of(value));
    for (const Json& group : groups) {
      if (!varied_.values.empty()) say("-{} {}: ", varied_.option, std::string(group[varied_.option]));
      std::vector<std::string> statuses;
      for (const auto& [status, count] : group["statuses"].items())
        statuses.push_back(fmt::format("{} {}", count.get<Index>(), status));
      say("means of {} runs{}\n", group["members"].get<Index>(),
          statuses.size() > 1 ? fmt::format(" ({})", fmt::join(statuses, ", ")) : "");
      for (const auto& [name, q] : group["results"].items())
        say("  {:<24} {:.6g} +- {} {}{}\n", name, number_of(q),
            q["error"].is_number() ? fmt::format("{:.2g}", Real(q["error"])) : "(unknown)", q.value("unit", ""),
            q["members"] == group["members"] ? "" : fmt::format(" (of {} runs)", q["members"].get<Index>()));
    }
    s["groups"] = std::move(groups);
    write_summary(p_.output, s);
  }

  const std::string& scenario_;
  const RunOptions& p_;
  const Options& options_;
  const RunMember& run_;
  Varied varied_;
  Json description_;
  MessageLog log_;
  RunControl control_;
  Index workers_, count_;
  std::optional<EnsembleFile> file_;
  std::map<Index, Json> done_;  ///< summaries or their kept parts
  bool unflushed_ = false;
  Real flushed_at_ = 0;
};

}  // namespace

ExitCode run_ensemble(const std::string& scenario, const RunOptions& p, const Options& options, const Ranks& ranks,
                      const RunMember& run) {
  if (ranks.several())
    throw InputError("-ensemble {}: start it without mpiexec; -ensemble_workers is the number of runs at a time",
                     p.ensemble);
  if (!options.declared("seed"))
    throw InputError("-ensemble {}: {} has no -seed in which its runs could differ; leave it out", p.ensemble,
                     scenario);
  if (options.declared("threads") && options.given("threads"))
    throw InputError(
        "-threads {}: each run of an ensemble has one thread; -ensemble_workers is the number of runs at a time",
        p.threads);
  if (!p.restart.empty())
    throw InputError("-ensemble {} with -restart {}: repeat the first command to resume an ensemble", p.ensemble,
                     p.restart);
  // The system would have to supply the same memory again for each member.
  ::mallopt(M_MMAP_THRESHOLD, 1 << 26);
  ::mallopt(M_TRIM_THRESHOLD, 1 << 28);
  Ensemble ensemble(scenario, p, options, ranks, run);
  return ensemble.run();
}

}  // namespace pliant
