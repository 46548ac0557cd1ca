// Restarts from checkpoints of which one entry is wrong, while the checksum fits.
#include <hdf5.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/io/checkpoint.h>
#include <pliant/scenarios/clog/clog.h>
#include <pliant/scenarios/hopper/hopper.h>
#include <pliant/scenarios/raft/raft.h>

#include "io/io_support.h"
#include "support/edit_checkpoint.h"
#include "support/silence.h"

namespace pliant::test::checkpoints_test {

namespace fs = std::filesystem;

namespace {

using Change = std::function<void(const fs::path&)>;  // of a checkpoint, whose checksum is made to fit afterwards

void run(const std::string& scenario, const Arguments& arguments) {
  const Silence silence;
  for (const Scenario& s : {hopper_scenario(), raft_scenario(), clog_scenario()})
    if (s.name == scenario) s.run(arguments, Ranks());
}

/// All bits that a run has computed.
std::string results(const fs::path& folder) {
  const auto file = hdf5::File::open_read(folder / "run.h5");
  std::string bits;
  const auto add = [&](const hdf5::Group& group, const std::string& name) {
    const std::vector<double> values = group.read<double>(name);
    bits.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
  };
  for (const char* table : {"series", "events"})
    if (file.has(table)) {
      const auto group = file.open_group(table);
      for (const std::string& column : group.links()) add(group, column);
    }
  const auto frames = file.open_group("frames");
  for (const std::string& name : frames.links()) {
    const auto frame = frames.open_group(name);
    for (const char* array : {"positions", "velocities"}) add(frame, array);
  }
  return bits;
}

/// A run that ended with a checkpoint, from which other runs continue for a few steps.
class StoppedRun {
 public:
  StoppedRun(std::string scenario, Arguments arguments, double end, const std::function<bool(const Checkpoint&)>& fit)
      : scenario_(std::move(scenario)) {
    const std::string folder = (scratch_ / "first").string();
    arguments.insert(arguments.end(), {"-output", folder, "-t_end", std::to_string(end)});
    run(scenario_, arguments);
    Checkpoint c;
    for (int more = 0;; ++more) {
      c = read_checkpoint(find_checkpoints(folder).files.at(0));
      if (fit(c)) break;
      REQUIRE(more < 200);
      end += 0.02;
      run(scenario_, {"-restart", folder, "-t_end", std::to_string(end)});
    }
    end_ = std::to_string(end + 0.1);
    if (const fs::path file = c.file; file.filename() == "checkpoint-b.h5")
      fs::rename(file, file.parent_path() / "checkpoint-a.h5");
    fs::remove(scratch_ / "first/checkpoint-b.h5");
    REQUIRE(attempt([](const fs::path&) {}) == "");
    expected_ = results(scratch_ / "again");
    REQUIRE(expected_ != results(scratch_ / "first"));
  }

  fs::path checkpoint() const { return scratch_ / "first/checkpoint-a.h5"; }

  /// Continues from a changed checkpoint. Returns the message of the InputError that stopped the run, or an empty
  /// string. Other errors are passed on.
  std::string attempt(const Change& change) {
    fs::remove_all(scratch_ / "again");
    fs::copy(scratch_ / "first", scratch_ / "again");
    change(scratch_ / "again/checkpoint-a.h5");
    seal_checkpoint(scratch_ / "again/checkpoint-a.h5");
    try {
      run(scenario_, {"-restart", (scratch_ / "again").string(), "-t_end", end_});
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  bool unchanged() const { return results(scratch_ / "again") == expected_; }

 private:
  ScratchFolder scratch_;
  std::string scenario_, end_, expected_;
};

/// edit(group) gets the group /state.
template <class Edit>
Change in_state(Edit edit) {
  return [edit](const fs::path& path) { edit_checkpoint(path, edit); };
}

template <class T>
void put(hdf5::Group& state, const std::string& name, const std::vector<T>& values, const hdf5::Shape& before) {
  state.remove(name);
  state.write(name, values, before.empty() && values.size() == 1 ? hdf5::Shape{} : hdf5::Shape{values.size()});
}

template <class T, class Other>
std::map<std::string, Change> changes_of(const std::string& name, const std::map<std::string, T>& wrong) {
  std::map<std::string, Change> changes;
  const auto with = [&](const char* how, auto&& edit) {
    changes[how] = in_state([=](hdf5::Group& state) {
      const hdf5::Shape shape = state.shape(name);
      std::vector<T> values = state.read<T>(name);
      edit(values);
      put(state, name, values, shape);
    });
  };
  with("cut", [](auto& values) { values.resize(values.size() / 2); });
  with("longer", [](auto& values) { values.push_back(values.empty() ? T(0) : values.back()); });
  for (const auto& [text, value] : wrong)
    with(text.c_str(), [value = value](auto& values) {
      if (!values.empty()) values[values.size() / 2] = value;
    });
  changes["wrong type"] = in_state([=](hdf5::Group& state) {
    const hdf5::Shape shape = state.shape(name);
    const auto values = state.read<double>(name);
    put(state, name, std::vector<Other>(values.begin(), values.end()), shape);
  });
  changes["removed"] = in_state([=](hdf5::Group& state) { state.remove(name); });
  changes["a group"] = in_state([=](hdf5::Group& state) {
    state.remove(name);
    state.create_group(name);
  });
  return changes;
}

const std::map<std::string, double> wrong_reals{
    {"nan", NAN}, {"inf", INFINITY}, {"-1", -1}, {"1e6", 1e6}, {"1e300", 1e300}};
const std::map<std::string, std::int64_t> wrong_integers{{"-1", -1},
                                                         {"1e6", 1000000},
                                                         {"huge", std::numeric_limits<std::int64_t>::max()},
                                                         {"-huge", std::numeric_limits<std::int64_t>::min()}};

/// edit(file) gets a file of HDF5's own functions.
template <class Edit>
Change in_file(Edit edit) {
  return [edit](const fs::path& path) {
    const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    REQUIRE(file >= 0);
    edit(file);
    H5Fclose(file);
  };
}

std::map<std::string, Change> changes_of_attribute(const std::string& name) {
  std::map<std::string, Change> changes;
  const auto set = [&](const std::string& how, auto value) {
    changes[how] = in_state([=](hdf5::Group& state) { state.set_attribute(name, value); });
  };
  const auto remove = [=](hid_t file) { REQUIRE(H5Adelete_by_name(file, "/state", name.c_str(), H5P_DEFAULT) >= 0); };
  changes["removed"] = in_file(remove);
  const auto replace = [=](hid_t file, hid_t space) {
    remove(file);
    const hid_t attribute = H5Acreate_by_name(file, "/state", name.c_str(), H5T_NATIVE_DOUBLE, space, H5P_DEFAULT,
                                              H5P_DEFAULT, H5P_DEFAULT);
    const std::vector<double> values(H5Sget_simple_extent_npoints(space), 1.0);
    REQUIRE(H5Awrite(attribute, H5T_NATIVE_DOUBLE, values.data()) >= 0);
    H5Aclose(attribute);
    H5Sclose(space);
  };
  changes["many"] = in_file([=](hid_t file) {
    const hsize_t count = 1000;
    replace(file, H5Screate_simple(1, &count, nullptr));
  });
  if (name == "time") {
    for (const auto& [text, value] : wrong_reals) set(text, value);
    set("text", std::string("soon"));
  } else if (name == "step") {
    for (const auto& [text, value] : wrong_integers) set(text, value);
    set("text", std::string("soon"));
  } else {
    set("empty", std::string());
    changes["number"] = in_file([=](hid_t file) { replace(file, H5Screate(H5S_SCALAR)); });
    set("nonsense", std::string("{\"n\": "));
    set("array", std::string("[1, 2]"));
    set("deep", std::string(100000, '['));
  }
  return changes;
}

std::map<std::string, Change> changes_of_options(const std::string& text) {
  std::map<std::string, Change> changes;
  const auto with = [&](const char* how, const char* name, const nlohmann::json& value) {
    nlohmann::json options = nlohmann::json::parse(text);
    options[name] = value;
    changes[how] = in_state([dump = options.dump()](hdf5::Group& state) { state.set_attribute("options", dump); });
  };
  with("unknown", "no_such_option", {{"value", 1}});
  with("no value", "n", 1);
  with("null", "n", {{"value", nullptr}});
  with("an object", "n", {{"value", nlohmann::json::object()}});
  with("text", "n", {{"value", "many"}});
  with("negative", "n", {{"value", -5}});
  with("one more", "n", {{"value", 17}});
  with("very many", "n", {{"value", 90000000}});
  return changes;
}

bool is_energy(const std::string& name) {
  return name == "start_energy" || name == "withdrawn" || name == "extra" || name.starts_with("audit_");
}

/// A plausible number: only the energy audit finds that it is wrong.
bool plausible(const std::string& name, const std::string& how) {
  if (is_energy(name)) return how == "-1" || how == "1e6" || how == "1e300";
  return how == "-1" && (name == "x" || name == "v" || name == "carried" || name == "last_velocity" ||
                         name == "list_reference" || name == "list_places");
}

/// Every fault of each entry must stop the run by an InputError, or have no effect.
void check_all(StoppedRun& stopped) {
  std::map<std::string, std::map<std::string, Change>> all;
  const Checkpoint c = read_checkpoint(stopped.checkpoint());
  for (const auto& [name, values] : c.reals) all[name] = changes_of<double, std::int64_t>(name, wrong_reals);
  for (const auto& [name, values] : c.integers) all[name] = changes_of<std::int64_t, double>(name, wrong_integers);
  for (const char* name : {"time", "step", "scenario", "options"}) all[name] = changes_of_attribute(name);
  all["options"].merge(changes_of_options(c.text("options")));
  for (const auto& [name, changes] : all)
    for (const auto& [how, change] : changes) {
      INFO(name << ": " << how);
      std::string refused;
      try {
        refused = stopped.attempt(change);
      } catch (const Error& error) {
        CHECK(error.code() == ExitCode::numerical_failure);
        CHECK_THAT(error.what(), Catch::Contains("energy is not conserved"));
        CHECK(plausible(name, how));
        continue;
      } catch (const std::exception& error) {
        FAIL_CHECK(error.what());
        continue;
      }
      CHECK(refused.find('\n') == refused.npos);
      CHECK((!refused.empty() || plausible(name, how) || stopped.unchanged()));
    }
}

}  // namespace

TEST_CASE("a hopper does not go on from a checkpoint that is wrong") {
  const std::string model = GENERATE("sp", "rough");
  Arguments arguments{
      "-n",    "16",  "-model", model, "-hopper_wall_distance", "5", "-hopper_width", "3", "-pack_fraction", "0.7",
      "-zeta", "0.1", "-e_w",   "1000"};
  if (model == "rough") arguments.insert(arguments.end(), {"-n_vertices", "8", "-e_c", "1000"});
  StoppedRun stopped("hopper", arguments, model == "sp" ? 3 : 6, [](const Checkpoint& c) {
    return !c.integers.at("list_relisted").empty() && c.integer("events") > 0;
  });
  check_all(stopped);
}

TEST_CASE("a raft does not go on from a checkpoint that is wrong") {
  StoppedRun stopped("raft", {"-rows", "3", "-columns", "3", "-delta", "0.01", "-v_wall", "2e-2", "-end_distance", "4"},
                     30, [](const Checkpoint& c) { return c.integer("events") > 0; });
  check_all(stopped);
}

TEST_CASE("a clog does not go on from a checkpoint that is wrong") {
  StoppedRun stopped("clog", {"-n", "12", "-seed", "3", "-g", "0.1", "-hopper_width", "2", "-phi_c", "3e-4"}, 340,
                     [](const Checkpoint& c) {
                       const auto& active = c.integers.at("active");
                       return c.real("opened_at") >= 0 && std::count(active.begin(), active.end(), 0) > 0;
                     });
  check_all(stopped);
}

}  // namespace pliant::test::checkpoints_test
