#include <pliant/io/checkpoint.h>

#include <algorithm>
#include <array>
#include <optional>
#include <stdexcept>
#include <utility>

#include <pliant/base/errors.h>
#include <pliant/io/atomic_file.h>
#include <pliant/io/hdf5.h>

namespace pliant {
namespace {

constexpr std::array names{"checkpoint-a.h5", "checkpoint-b.h5"};

Checkpoint read_checkpoint(const std::filesystem::path& path) {
  const auto file = hdf5::File::open_read(path);
  const auto group = file.open_group("state");
  Checkpoint checkpoint;
  const auto x = group.read<double>("x"), v = group.read<double>("v", {x.size()}),
             a = group.read<double>("a", {x.size()});
  checkpoint.state.assign(x, v, a);
  checkpoint.state.t = group.real_attribute("time");
  checkpoint.state.step = group.integer_attribute("step");
  checkpoint.strings = group.string_attributes();
  for (const std::string& name : group.links()) {
    if (name == "x" || name == "v" || name == "a") continue;
    if (group.holds_integers(name))
      checkpoint.integers[name] = group.read<std::int64_t>(name);
    else
      checkpoint.reals[name] = group.read<double>(name);
  }
  return checkpoint;
}

struct Found {
  std::optional<NewestCheckpoint> newest;
  int index = -1;
  std::vector<std::string> problems;
};

/// Reads both files; the later file wins where the steps are equal.
Found find_newest(const std::filesystem::path& folder) {
  Found found;
  std::filesystem::file_time_type newest_time;
  for (int i = 0; i < 2; ++i) {
    const auto path = folder / names[i];
    std::error_code error;
    const auto time = std::filesystem::last_write_time(path, error);
    if (error) continue;
    try {
      Checkpoint checkpoint = read_checkpoint(path);
      const auto rank = [](const Checkpoint& c, auto t) { return std::pair(c.state.step, t); };
      if (found.newest && rank(checkpoint, time) < rank(found.newest->checkpoint, newest_time)) continue;
      found.newest = {std::move(checkpoint), path.string(), {}};
      found.index = i;
      newest_time = time;
    } catch (const Error& problem) {
      found.problems.emplace_back(problem.what());
    }
  }
  return found;
}

}  // namespace

CheckpointWriter::CheckpointWriter(std::filesystem::path folder) : folder_(std::move(folder)) {
  next_ = find_newest(folder_).index == 0 ? 1 : 0;
}

void CheckpointWriter::write(const Checkpoint& checkpoint) {
  const auto path = folder_ / names[next_];
  // Built in memory, so that a full disk cannot leave HDF5 with a file that it can neither write nor close.
  auto file = hdf5::File::in_memory(path.string());
  auto group = file.create_group("state");
  const auto write = [&](const std::string& name, const auto& values) {
    if (group.has(name)) throw std::invalid_argument("checkpoint: the name " + name + " is used twice");
    group.write(name, values, {values.size()}, hdf5::Storage::checksum);
  };
  group.set_attribute("time", checkpoint.state.t);
  group.set_attribute("step", checkpoint.state.step);
  write("x", checkpoint.state.x());
  write("v", checkpoint.state.v());
  write("a", checkpoint.state.a());
  for (const auto& [name, values] : checkpoint.reals) write(name, values);
  for (const auto& [name, values] : checkpoint.integers) write(name, values);
  for (const auto& [name, value] : checkpoint.strings) {
    if (name == "time" || name == "step")
      throw std::invalid_argument("checkpoint: the name " + name + " is used twice");
    group.set_attribute(name, value);
  }
  write_file_atomically(path, file.image());
  next_ = 1 - next_;
}

NewestCheckpoint read_newest_checkpoint(const std::filesystem::path& folder) {
  auto found = find_newest(folder);
  if (!found.newest && found.problems.empty())
    throw InputError("there is no checkpoint in {}; give -restart the -output folder of a run that wrote one",
                     folder.string());
  if (!found.newest)
    throw InputError("no checkpoint in {} can be read ({}); start the run again", folder.string(),
                     found.problems.front());
  if (!found.problems.empty())
    found.newest->message = found.problems.front() + "; going on from " + found.newest->file + " (step " +
                            std::to_string(found.newest->checkpoint.state.step) + ")";
  return *std::move(found.newest);
}

}  // namespace pliant
