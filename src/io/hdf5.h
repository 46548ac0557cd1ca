// A small RAII layer over the HDF5 C API: HDF5 prints nothing itself, and every failure becomes an OutputError
// (writing) or an InputError (reading) that names the file, the object and the system's reason if HDF5 reports it.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <ranges>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <pliant/io/journaled_file.h>

namespace pliant::hdf5 {

using Shape = std::vector<std::uint64_t>;
/// In an expected shape: any length of this dimension.
inline constexpr std::uint64_t any_length = ~std::uint64_t{0};

template <class T>
concept Element = std::same_as<T, double> || std::same_as<T, float> || std::same_as<T, std::int32_t> ||
    std::same_as<T, std::int64_t> || std::same_as<T, std::uint8_t>;

enum class Type { real, single, int32, int64, uint8 };

/// Bytes of a value, in memory and in files that this machine writes.
std::size_t size_of(Type type);

template <Element T>
constexpr Type type_of() {
  if constexpr (std::same_as<T, double>) return Type::real;
  if constexpr (std::same_as<T, float>) return Type::single;
  if constexpr (std::same_as<T, std::int32_t>) return Type::int32;
  if constexpr (std::same_as<T, std::int64_t>) return Type::int64;
  if constexpr (std::same_as<T, std::uint8_t>) return Type::uint8;
}

/// crc32: with the CRC-32 of the values, as they are in the file, in the attribute "crc32", for Group::check().
enum class Storage { plain, crc32 };

/// Whether the HDF5 library can compress values by zlib (deflate); some builds cannot.
bool can_deflate();

/// Values in one row of the first dimension.
std::uint64_t row_width(const Shape& shape);

/// The HDF5 library's version, "1.10.8".
std::string library_version();

/// Owner of one HDF5 identifier (hid_t, without its header).
class Id {
 public:
  Id() = default;
  explicit Id(std::int64_t id) : id_(id) {}
  Id(Id&& other) noexcept : id_(std::exchange(other.id_, -1)) {}
  Id& operator=(Id&& other) noexcept {
    Id(std::move(other)).swap(*this);
    return *this;
  }
  void swap(Id& other) noexcept { std::swap(id_, other.id_); }
  Id(const Id&) = delete;
  Id& operator=(const Id&) = delete;
  ~Id();
  std::int64_t get() const { return id_; }
  std::int64_t release() { return std::exchange(id_, -1); }
  bool valid() const { return id_ >= 0; }

 private:
  std::int64_t id_ = -1;
};

struct Recorded;

/// A dataset whose rows are written piece by piece. Errors of all members: OutputError.
class Dataset {
 public:
  /// Writes `rows` whole rows of values of the dataset's type, from row `first` on.
  void write(std::uint64_t first, std::uint64_t rows, const void* values);
  /// Where its values begin in the file, row after row as in memory: for ranks that write them past HDF5. 0 without
  /// values, or for compressed values.
  std::uint64_t address() const;
  /// Stores the CRC-32 of all values for Group::check().
  void set_crc32(std::uint32_t value);

 private:
  friend class Group;
  Dataset(Id id, Type type, std::string file, std::string path)
      : id_(std::move(id)), type_(type), file_(std::move(file)), path_(std::move(path)) {}
  explicit Dataset(std::shared_ptr<Recorded> recorded);

  Id id_;
  std::shared_ptr<Recorded> recorded_;  ///< instead of a dataset in a file
  Type type_;
  std::string file_, path_;  ///< for messages
};

/// A dataset [rows, …row] of doubles that grows along its first dimension and stores its CRC-32.
class Rows {
 public:
  /// Appends values.size() / (product of row) rows. Errors: OutputError.
  void append(std::span<const double> values);
  std::uint64_t rows() const { return shape_[0]; }

 private:
  friend class Group;
  Rows(Id dataset, Shape shape, std::string file, std::string path)
      : dataset_(std::move(dataset)), shape_(std::move(shape)), file_(std::move(file)), path_(std::move(path)) {}

  Id dataset_, attribute_;
  Shape shape_;
  std::uint32_t crc32_ = 0;
  std::string file_, path_;  ///< for messages
};

/// A group of a file. Names are paths relative to it, or absolute; missing groups on the way are created. A file that
/// is closed closes its groups too. All members: OutputError where writing fails, InputError where reading does.
class Group {
 public:
  Group create_group(const std::string& name);
  Group open_group(const std::string& name) const;
  /// A group without a name, which vanishes unless link() names it: readers see its full content or nothing.
  Group create_unlinked_group();
  /// Names `group`, replacing the object of that name.
  void link(const Group& group, const std::string& name);
  /// A second name for the object at `existing` (a path): the same storage, nothing is copied.
  void link(const std::string& existing, const std::string& name);

  /// Writes the objects of a message (File::recorded()) into this group of a file.
  void add(std::string_view message);

  bool has(const std::string& name) const;
  bool has_group(const std::string& name) const;
  /// Names in this group, sorted.
  std::vector<std::string> links() const;
  void remove(const std::string& name);

  /// Writes values (vector, span or array of a type of `Element`) as a new dataset; the product of shape is their
  /// number.
  template <std::ranges::contiguous_range Values>
  requires Element<std::ranges::range_value_t<Values>>
  void write(const std::string& name, const Values& values, const Shape& shape, Storage storage = Storage::plain) {
    write_values(name, type_of<std::ranges::range_value_t<Values>>(), std::ranges::data(values),
                 std::ranges::size(values), shape, storage);
  }
  /// A new dataset for rows that are written piece by piece, from the first to the last if they are compressed.
  /// deflate: 0: allocated in the file at once; 1 to 9: level of compression, for which can_deflate() must be true.
  Dataset create_dataset(const std::string& name, Type type, const Shape& shape, int deflate = 0);
  /// A new dataset that shows values of another one, which HDF5 finds when they are read: nothing is copied. `source`:
  /// absolute path of a dataset [rows] or [rows, columns] of this type. The first `columns` of its values are shown,
  /// row after row, from column `first` of the new dataset on; the other columns are 0.
  struct View {
    std::string source;
    Type type;
    Shape source_shape;
    std::uint64_t columns;
    Shape shape;  ///< shape of the new dataset
    std::uint64_t first = 0;
  };
  void write_view(const std::string& name, const View& view);
  /// A new dataset of this value throughout: HDF5's fill value, so that the dataset takes no space for any length.
  template <Element T>
  void write_constant(const std::string& name, T value, const Shape& shape) {
    write_fill_value(name, type_of<T>(), &value, shape);
  }
  /// Reads a whole dataset, converting numbers to T. Errors: also where the shape is not `expected` (if given), or
  /// where real numbers would be cut to integers.
  template <Element T>
  std::vector<T> read(const std::string& name, const Shape& expected) const {
    const Shape found = checked_shape(name, expected);
    std::size_t count = 1;
    for (const auto length : found) count *= length;
    std::vector<T> values(count);
    read_values(name, type_of<T>(), values.data());
    return values;
  }
  template <Element T>
  std::vector<T> read(const std::string& name) const {
    return read<T>(name, shape(name));
  }
  Shape shape(const std::string& name) const;
  /// Whether the dataset holds integers.
  bool holds_integers(const std::string& name) const;
  /// Bytes of one of its values.
  std::size_t value_size(const std::string& name) const;

  /// Reads the dataset and compares its values with their CRC-32. Errors: InputError if they differ, or if there is no
  /// CRC-32.
  void check(const std::string& name) const;

  /// Creates a dataset [0, …row]; row = {} makes rows of one number.
  Rows create_rows(const std::string& name, const Shape& row, std::uint64_t rows_per_chunk);
  /// Opens such a dataset, which is checked, and cuts it to its first `rows` rows. Errors: InputError if there are
  /// fewer.
  Rows open_rows(const std::string& name, std::uint64_t rows);

  /// Writes a text as a new dataset: one string of fixed length, with its CRC-32. Strings of variable length lie in
  /// HDF5's global heap, which has no checksum; HDF5 crashes on a damaged one.
  void write_text(const std::string& name, const std::string& text);
  /// Reads such a text. Errors: InputError also where its CRC-32 differs.
  std::string read_text(const std::string& name) const;

  /// Stores the number of names in this group as the attribute "members", so that a reader notices a missing one.
  void count_members();

  /// Attributes; a new value replaces the old one. HDF5 has checksums for numbers, but not for strings.
  void set_attribute(const std::string& name, const std::string& value);
  void set_attribute(const std::string& name, double value);
  void set_attribute(const std::string& name, std::int64_t value);
  std::string string_attribute(const std::string& name) const;
  double real_attribute(const std::string& name) const;
  std::int64_t integer_attribute(const std::string& name) const;
  /// All attributes that are strings.
  std::map<std::string, std::string> string_attributes() const;
  /// Names of all datasets below that have values and a checksum, as paths relative to the group, without second names
  /// of datasets.
  std::vector<std::string> datasets() const;

 protected:
  [[noreturn]] void fail_write(const std::string& name) const;

  Group() = default;
  Group(Id id, std::string file, std::string path)
      : id_(std::move(id)), file_(std::move(file)), path_(std::move(path)) {}
  Group(std::shared_ptr<Recorded> recorded, std::string file, std::string path)
      : recorded_(std::move(recorded)), file_(std::move(file)), path_(std::move(path)) {}

  Id id_;
  std::shared_ptr<Recorded> recorded_;  ///< instead of a group in a file
  std::string file_;                    ///< for messages
  std::string path_;                    ///< for messages

 private:
  friend class MessageReader;
  std::string full(const std::string& name) const;
  [[noreturn]] void fail_read(const std::string& name) const;
  Id new_dataset(const std::string& name, Type type, const Shape& shape, std::int64_t properties);
  void write_values(const std::string& name, Type type, const void* values, std::size_t count, const Shape& shape,
                    Storage storage);
  void write_whole(const std::string& name, Type type, const void* values, const Shape& shape,
                   std::optional<std::uint32_t> sum);
  void write_fill_value(const std::string& name, Type type, const void* value, const Shape& shape);
  Shape checked_shape(const std::string& name, const Shape& expected) const;
  void read_values(const std::string& name, Type type, void* values) const;
  std::uint32_t check(const std::string& name, const Id& dataset, std::uint64_t rows) const;
  void set_number(const std::string& name, Type type, const void* value);
  void read_number(const std::string& name, Type type, void* value) const;
};

/// An open file, and its root group.
class File : public Group {
 public:
  /// Errors: OutputError if the file exists or cannot be created.
  static File create(const std::filesystem::path& path);
  /// A file in memory only; `name` is for messages. See image().
  static File in_memory(const std::string& name);
  /// No file: its groups keep the objects that are written to them, and another process can add() these objects to a
  /// file. Allowed are the members of a group that write (except create_rows and write_view), has(), open_group() and
  /// shape().
  static File recorder(const std::string& name);
  /// Errors: InputError if the file is missing, damaged, or open for writing elsewhere.
  static File open_read(const std::filesystem::path& path);
  /// Errors: InputError as for reading; OutputError without permission to write.
  static File open_write(const std::filesystem::path& path);

  File(File&&) noexcept = default;
  File& operator=(File&&) = delete;
  ~File();

  bool is_open() const { return file_id_.valid() || recorded_; }
  const std::string& name() const { return file_; }
  /// Gives the file on disk another name. Groups opened before have the old one in their messages. Errors: OutputError.
  void rename(const std::filesystem::path& path);
  /// Keeps fewer descriptions of objects in memory: for a file to which many small objects are written, none of them in
  /// a group without a name. The writer touches few of them again, and HDF5 goes through all of them at each flush.
  void keep_little_metadata();
  /// Commits everything written so far: after a kill of this process, or a loss of power, the file has at least this
  /// content. Errors: OutputError; the file stays as it was after the last flush, and the next flush tries again.
  void flush();
  /// Addresses (Dataset::address()) below were committed by the last flush and must not be written past HDF5.
  std::uint64_t committed() const { return disk_->committed(); }
  /// Flushes and closes. Without close(), the destructor discards all changes since the last flush.
  void close();
  /// The bytes of a file in memory as they would be on disk; valid until the file is changed.
  std::string_view image();
  /// The objects of a recorder, as a message to another process of this program.
  std::string recorded() const;

 private:
  explicit File(std::string name);
  File(Id file, std::string name, std::unique_ptr<JournaledFile> disk);
  static File open(JournaledFile disk, const std::filesystem::path& path, bool writable);
  void abandon();

  std::unique_ptr<JournaledFile> disk_;  ///< none: in memory, or a recorder
  bool writable_ = true;
  Id file_id_;
};

}  // namespace pliant::hdf5
