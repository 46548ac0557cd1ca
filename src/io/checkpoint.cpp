#include <pliant/io/checkpoint.h>

#include <array>
#include <stdexcept>
#include <utility>

#include <pliant/base/errors.h>
#include <pliant/io/atomic_file.h>

namespace pliant {
namespace {

constexpr std::array names{"checkpoint-a.h5", "checkpoint-b.h5"};

/// Reads the whole file; take(name, values) gets each array, the checkpoint the rest.
template <class Take>
void read(const std::filesystem::path& path, Checkpoint& checkpoint, Take&& take) {
  const auto file = hdf5::File::open_read(path);
  const auto group = file.open_group("state");
  checkpoint.t = group.real_attribute("time");
  checkpoint.step = group.integer_attribute("step");
  checkpoint.strings = group.string_attributes();
  for (const std::string& name : group.links()) {
    if (group.holds_integers(name))
      take(name, group.read<std::int64_t>(name));
    else
      take(name, group.read<double>(name));
  }
}

struct Found {
  int index = -1;  ///< of the file; −1: none can be read
  std::vector<std::string> problems;
};

/// Checks both files; the later file wins where the steps are equal.
Found find_newest(const std::filesystem::path& folder) {
  Found found;
  std::pair<std::int64_t, std::filesystem::file_time_type> newest;
  for (int i = 0; i < 2; ++i) {
    const auto path = folder / names[i];
    std::error_code error;
    const auto time = std::filesystem::last_write_time(path, error);
    if (error) continue;
    try {
      Checkpoint checkpoint;
      read(path, checkpoint, [](const auto&...) {});
      const std::pair rank(checkpoint.step, time);
      if (found.index >= 0 && rank < newest) continue;
      found.index = i;
      newest = rank;
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

void CheckpointWriter::begin(Real t, std::int64_t step) {
  // In memory, so that a full disk cannot leave HDF5 with a file that it can neither write nor close.
  group_.reset();
  file_.reset();  // HDF5 opens no name twice
  file_.emplace(hdf5::File::in_memory((folder_ / names[next_]).string()));
  group_.emplace(file_->create_group("state"));
  group_->set_attribute("time", t);
  group_->set_attribute("step", step);
}

void CheckpointWriter::check_new(const std::string& name) const {
  if (group_->has(name)) throw std::invalid_argument("checkpoint: the name " + name + " is used twice");
}

void CheckpointWriter::add_text(const std::string& name, const std::string& text) {
  if (name == "time" || name == "step") throw std::invalid_argument("checkpoint: the name " + name + " is used twice");
  group_->set_attribute(name, text);
}

void CheckpointWriter::finish() {
  group_.reset();
  hdf5::File file = *std::move(file_);
  file_.reset();
  write_file_atomically(folder_ / names[next_], file.image());
  next_ = 1 - next_;
}

NewestCheckpoint read_newest_checkpoint(const std::filesystem::path& folder) {
  const Found found = find_newest(folder);
  if (found.index < 0 && found.problems.empty())
    throw InputError("there is no checkpoint in {}; give -restart the -output folder of a run that wrote one",
                     folder.string());
  if (found.index < 0)
    throw InputError("no checkpoint in {} can be read ({}); start the run again", folder.string(),
                     found.problems.front());
  const auto path = folder / names[found.index];
  NewestCheckpoint newest{{}, path.string(), ""};
  Checkpoint& checkpoint = newest.checkpoint;
  read(path, checkpoint, [&]<class T>(const std::string& name, std::vector<T> values) {
    if constexpr (std::is_same_v<T, double>)
      checkpoint.reals[name] = std::move(values);
    else
      checkpoint.integers[name] = std::move(values);
  });
  if (!found.problems.empty())
    newest.message =
        found.problems.front() + "; going on from " + newest.file + " (step " + std::to_string(checkpoint.step) + ")";
  return newest;
}

}  // namespace pliant
