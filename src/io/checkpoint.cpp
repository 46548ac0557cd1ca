#include <pliant/io/checkpoint.h>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string_view>

#include <pliant/base/regular_file.h>
#include <pliant/io/atomic_file.h>
#include <pliant/io/crc32.h>

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr std::array file_names{"checkpoint-a.h5", "checkpoint-b.h5"};

// A file is a head, which HDF5 skips as a "user block", and an HDF5 file. The head is a line of text, filled up with
// zeros, with length and checksum of the bytes behind it, so that a change of any bit is detected.
constexpr int format = 2;
constexpr std::size_t head_size = 512;
constexpr std::string_view title = "pliant checkpoint, format ";
constexpr std::string_view hdf5_signature = "\x89HDF";

std::string make_head(std::uint64_t bytes, std::uint32_t crc) {
  std::string head =
      fmt::format("{}{}; {} bytes from byte {} on with the CRC-32 {:08x}\n", title, format, bytes, head_size, crc);
  head.resize(head_size, '\0');
  return head;
}

/// Throws InputError unless the head fits the rest of the file.
void verify(const fs::path& path) {
  const auto refuse = [&](std::string_view why) { throw InputError("{} {}", path.string(), why); };
  const int file = open_regular(path, O_RDONLY);
  if (file < 0) refuse("cannot be opened; check its permissions");
  const std::unique_ptr<const int, void (*)(const int*)> closer(&file, [](const int* open) { ::close(*open); });
  std::vector<char> buffer(1 << 16);
  const auto read = [&](std::size_t most) {
    const ssize_t got = read_some(file, buffer.data(), most);
    if (got < 0) refuse("cannot be read");
    return std::string_view(buffer.data(), static_cast<std::size_t>(got));
  };
  const std::string head(read(head_size));
  if (head.starts_with(hdf5_signature))
    refuse("is of format 1, which this version does not read; restart with the version that wrote it");
  if (!head.starts_with(title)) refuse("is not a checkpoint, or is damaged");
  const std::string_view number = std::string_view(head).substr(title.size(), head.find(';') - title.size());
  if (number != std::to_string(format))
    refuse(fmt::format("is of format {:.20}, and this version reads format {}; restart with the version that wrote it",
                       number, format));
  std::uint64_t bytes = 0;
  std::uint32_t crc = 0;
  for (std::string_view part; !(part = read(buffer.size())).empty(); bytes += part.size())
    crc = crc32_of(std::as_bytes(std::span(part)), crc);
  if (head != make_head(bytes, crc)) refuse("is damaged: its length or its checksum is wrong");
}

hdf5::Group open_state(const hdf5::File& file) { return file.open_group("state"); }

/// One of the maps of a checkpoint.
template <class Map>
const auto& entry(const Checkpoint& c, const Map& map, const std::string& name, const char* kind) {
  const auto found = map.find(name);
  if (found == map.end())
    c.refuse("it has no {} named {}; continue the run with the version of the program that wrote it", kind, name);
  return found->second;
}

/// The bound of unbounded numbers.
constexpr double unbounded(double) { return Checkpoint::any; }
constexpr std::int64_t unbounded(std::int64_t) { return Checkpoint::any_count; }

template <class T>
const std::vector<T>& checked(const Checkpoint& c, const std::map<std::string, std::vector<T>>& arrays,
                              const std::string& name, std::size_t length, T least, T most) {
  const std::vector<T>& values = entry(c, arrays, name, std::is_same_v<T, double> ? "real numbers" : "integers");
  if (values.size() != length) c.refuse("{} has {} values instead of {}", name, values.size(), length);
  const auto wrong =
      std::find_if(values.begin(), values.end(), [&](T value) { return !(least <= value && value <= most); });
  if (wrong == values.end()) return values;
  const std::string which = length == 1 ? name : fmt::format("{}[{}]", name, wrong - values.begin());
  if constexpr (std::is_same_v<T, double>)
    if (!std::isfinite(*wrong)) c.refuse("{} = {} is not finite", which, *wrong);
  if (least == most) c.refuse("{} = {} instead of {}", which, *wrong, least);
  if (most == unbounded(most)) c.refuse("{} = {} is less than {}", which, *wrong, least);
  c.refuse("{} = {} is not in the range {} … {}", which, *wrong, least, most);
}

}  // namespace

// ---- checked entries -------------------------------------------------------------------------------------------

Real Checkpoint::real(const std::string& name, Real least, Real most) const {
  return checked(*this, reals, name, 1, least, most).front();
}

std::int64_t Checkpoint::integer(const std::string& name, std::int64_t least, std::int64_t most) const {
  return checked(*this, integers, name, 1, least, most).front();
}

const std::vector<double>& Checkpoint::real_array(const std::string& name, std::size_t length, Real least,
                                                  Real most) const {
  return checked(*this, reals, name, length, least, most);
}

const std::vector<std::int64_t>& Checkpoint::integer_array(const std::string& name, std::size_t length,
                                                           std::int64_t least, std::int64_t most) const {
  return checked(*this, integers, name, length, least, most);
}

std::size_t Checkpoint::length(const std::string& name) const {
  if (const auto found = integers.find(name); found != integers.end()) return found->second.size();
  return entry(*this, reals, name, "array").size();
}

const std::string& Checkpoint::text(const std::string& name) const { return entry(*this, strings, name, "text"); }

// ---- writing ---------------------------------------------------------------------------------------------------

CheckpointWriter::CheckpointWriter(fs::path folder, const fs::path& newest)
    : folder_(std::move(folder)), next_(newest.filename() == file_names[0] ? 1 : 0) {}

void CheckpointWriter::begin(Real t, std::int64_t step) {
  // In memory, so that a full disk cannot leave HDF5 with a file that it can neither write nor close.
  group_.reset();
  file_.reset();  // HDF5 opens no name twice
  file_.emplace(hdf5::File::in_memory((folder_ / file_names[next_]).string()));
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
  const std::string_view image = file.image();
  write_file_atomically(folder_ / file_names[next_],
                        {make_head(image.size(), crc32_of(std::as_bytes(std::span(image)))), image});
  next_ = 1 - next_;
}

// ---- reading ---------------------------------------------------------------------------------------------------

bool has_checkpoint(const fs::path& folder) {
  return std::any_of(file_names.begin(), file_names.end(), [&](const char* name) {
    std::error_code ignored;
    return fs::exists(folder / name, ignored);
  });
}

StoredCheckpoints find_checkpoints(const fs::path& folder) {
  StoredCheckpoints stored;
  struct Whole {
    std::int64_t step;
    fs::file_time_type time;
    fs::path path;
  };
  std::vector<Whole> whole;
  for (const char* name : file_names) {
    const fs::path path = folder / name;
    std::error_code error;
    const auto time = fs::last_write_time(path, error);
    if (error) continue;
    try {
      verify(path);
      whole.push_back({open_state(hdf5::File::open_read(path)).integer_attribute("step"), time, path});
    } catch (const MemoryError&) {
      throw;
    } catch (const Error& problem) {
      stored.problems.emplace_back(problem.what());
    }
  }
  // Where the steps are equal the later file comes first.
  std::stable_sort(whole.begin(), whole.end(), [](const Whole& a, const Whole& b) {
    return std::pair(a.step, a.time) > std::pair(b.step, b.time);
  });
  for (Whole& w : whole) stored.files.push_back(std::move(w.path));
  if (stored.files.empty() && stored.problems.empty())
    throw InputError("there is no checkpoint in {}; restart from the folder of a run that has one", folder.string());
  return stored;
}

Checkpoint read_checkpoint(const fs::path& path) {
  Checkpoint c;
  c.file = path.string();
  const auto file = hdf5::File::open_read(path);
  const auto group = open_state(file);
  c.t = group.real_attribute("time");
  c.step = group.integer_attribute("step");
  if (!(c.t >= 0) || !std::isfinite(c.t) || c.step < 0) c.refuse("its time {} and step {} are impossible", c.t, c.step);
  c.strings = group.string_attributes();
  const auto bytes = static_cast<double>(fs::file_size(path));
  for (const std::string& name : group.links()) {
    double values = 1;
    for (const std::uint64_t length : group.shape(name)) values *= static_cast<double>(length);
    if (values > bytes) c.refuse("the stated length of {}, {:.3g} values, exceeds the size of the file", name, values);
    if (group.holds_integers(name))
      c.integers[name] = group.read<std::int64_t>(name);
    else
      c.reals[name] = group.read<double>(name);
  }
  return c;
}

}  // namespace pliant
