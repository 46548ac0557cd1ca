#include <pliant/io/crc32.h>
#include <pliant/io/hdf5.h>
#include <pliant/io/hdf5_driver.h>
#include <pliant/io/recording.h>

#include <hdf5.h>

#include <algorithm>
#include <exception>
#include <functional>
#include <mutex>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string_view>

#include <pliant/base/errors.h>
#include <pliant/base/petsc.h>

namespace pliant::hdf5 {
namespace {

static_assert(sizeof(hid_t) == sizeof(std::int64_t) && sizeof(hsize_t) == sizeof(std::uint64_t));

/// Switches HDF5's printing of errors off for a scope.
class Quiet {
 public:
  Quiet() {
    H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
    if (function_ != nullptr) H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~Quiet() {
    if (function_ != nullptr) H5Eset_auto2(H5E_DEFAULT, function_, data_);
  }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

/// Names that functions of HDF5 visit, which no exception may pass through.
class Names {
 public:
  /// For the visiting function: less than 0 stops the visit.
  static herr_t add(void* names, const char* name) noexcept {
    auto& self = *static_cast<Names*>(names);
    try {
      self.list_.emplace_back(name);
      return 0;
    } catch (...) {
      self.error_ = std::current_exception();
      return -1;
    }
  }
  /// Errors: as thrown while adding.
  std::vector<std::string> take() {
    if (error_) std::rethrow_exception(error_);
    return std::move(list_);
  }

 private:
  std::vector<std::string> list_;
  std::exception_ptr error_;
};

/// Message from the error stack of the last HDF5 call: the system's message if there is one, else its innermost entry.
std::string reason() {
  std::string found;
  bool from_system = false;
  const auto visit = [&](std::string_view text) {
    constexpr std::string_view mark = "error message = '";
    if (text.find("unable to lock file") != text.npos) {
      found = "another program has it open";
      from_system = true;
    } else if (const auto at = text.find(mark); at != text.npos && !from_system) {
      text.remove_prefix(at + mark.size());
      found = text.substr(0, text.find('\''));
      from_system = true;
    } else if (found.empty()) {
      found = text;
    }
  };
  H5Ewalk2(
      H5E_DEFAULT, H5E_WALK_UPWARD,
      [](unsigned, const H5E_error2_t* entry, void* f) -> herr_t {
        if (entry->desc != nullptr) (*static_cast<decltype(visit)*>(f))(entry->desc);
        return 0;
      },
      const_cast<void*>(static_cast<const void*>(&visit)));
  return found.empty() ? "HDF5 gives no reason" : found;
}

hid_t native(Type type) {
  switch (type) {
    case Type::real:
      return H5T_NATIVE_DOUBLE;
    case Type::single:
      return H5T_NATIVE_FLOAT;
    case Type::int32:
      return H5T_NATIVE_INT32;
    case Type::int64:
      return H5T_NATIVE_INT64;
    case Type::uint8:
      return H5T_NATIVE_UINT8;
  }
  throw std::logic_error("unknown element type");
}

/// For calls that change an object in memory, such as a property list: only a lack of memory makes them fail.
void require_memory(herr_t status) {
  if (status < 0) throw MemoryError("HDF5's memory for a property could not be allocated");
}

std::string text(const Shape& shape) {
  std::string s = "[";
  for (std::size_t i = 0; i < shape.size(); ++i)
    s += (i > 0 ? ", " : "") + (shape[i] == any_length ? std::string("any") : std::to_string(shape[i]));
  return s + "]";
}

std::uint64_t product(std::span<const std::uint64_t> lengths) {
  return std::accumulate(lengths.begin(), lengths.end(), std::uint64_t{1}, std::multiplies<>());
}

const hsize_t* dims(const Shape& shape) { return reinterpret_cast<const hsize_t*>(shape.data()); }

Id string_type() {
  Id type(H5Tcopy(H5T_C_S1));
  require_memory(H5Tset_size(type.get(), H5T_VARIABLE));
  require_memory(H5Tset_cset(type.get(), H5T_CSET_UTF8));
  return type;
}

/// Settings of the library, before its first file. HDF5 1.10 leaks the header of an object that fails its checksum, and
/// prints "infinite loop closing library" when MPI ends, which is when PETSc ends. HDF5 reuses the memory of small
/// objects, but by default returns it to the system when 64 KiB of a kind are free, as after each flush.
void prepare_library() {
  static std::once_flag once;
  std::call_once(once, [] {
    constexpr int unlimited = -1, default_of_all = 16 << 20, default_of_one = 1 << 20;
    require_memory(H5set_free_list_limits(unlimited, unlimited, unlimited, unlimited, default_of_all, default_of_one));
    petsc_check(PetscRegisterFinalize([]() -> PetscErrorCode {
      H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
      return 0;
    }));
  });
}

Id file_access() {
  prepare_library();
  Id access(H5Pcreate(H5P_FILE_ACCESS));
  // Closing the file closes all objects in it.
  require_memory(H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG));
  // The format of HDF5 1.8 has checksums for nearly everything except the values; the format of 1.10 would lock readers
  // out of the file of a killed run.
  require_memory(H5Pset_libver_bounds(access.get(), H5F_LIBVER_V18, H5F_LIBVER_LATEST));
  return access;
}

Id disk_access(JournaledFile& disk) {
  Id access = file_access();
  use_journaled_file(access.get(), disk);
  return access;
}

constexpr std::size_t memory_step = 1 << 18;  ///< bytes by which a file in memory grows
constexpr const char* crc32_name = "crc32";
constexpr const char* members_name = "members";

/// A list of properties for all objects of a kind, because HDF5 takes as long to make a list as a small dataset.
/// The program keeps the list until its end.
hid_t lasting(hid_t kind, const std::function<void(const Id&)>& set) {
  Id list(H5Pcreate(kind));
  set(list);
  return list.release();
}

/// The space of a single value.
hid_t scalar() {
  static const hid_t lasting_space = [] {
    Id space(H5Screate(H5S_SCALAR));
    require_memory(space.valid() ? 0 : -1);
    return space.release();
  }();
  return lasting_space;
}

/// For groups: few links, stored in the group's header.
void keep_links_in_header(const Id& properties) {
  require_memory(H5Pset_link_phase_change(properties.get(), 64, 32));
  require_memory(H5Pset_est_link_info(properties.get(), 16, 14));
}

hid_t few_links() {
  static const hid_t list = lasting(H5P_GROUP_CREATE, keep_links_in_header);
  return list;
}

Id new_file() {
  Id properties(H5Pcreate(H5P_FILE_CREATE));
  keep_links_in_header(properties);
  return properties;
}

/// Space is never used twice: ranks write past HDF5 to addresses that must be new.
Id new_file_on_disk() {
  Id properties = new_file();
  require_memory(H5Pset_file_space_strategy(properties.get(), H5F_FSPACE_STRATEGY_NONE, false, 1));
  return properties;
}

/// Throws a MemoryError if that is why the last HDF5 call has failed.
void check_memory(const std::string& path, const std::string& file) {
  bool lacks = false;
  H5Ewalk2(
      H5E_DEFAULT, H5E_WALK_UPWARD,
      [](unsigned, const H5E_error2_t* entry, void* found) -> herr_t {
        if (entry->maj_num == H5E_RESOURCE || entry->min_num == H5E_CANTALLOC) *static_cast<bool*>(found) = true;
        return 0;
      },
      &lacks);
  if (lacks) throw MemoryError(fmt::format("HDF5's memory for {} of {} could not be allocated", path, file));
}

[[noreturn]] void fail_to_write(const std::string& path, const std::string& file) {
  check_memory(path, file);
  const std::string why = reason();
  throw OutputError("cannot write {} of {}: {}; check free space and permissions", path, file, why);
}

Shape shape_of(const Id& dataset) {
  const Id space(H5Dget_space(dataset.get()));
  Shape shape(static_cast<std::size_t>(std::max(0, H5Sget_simple_extent_ndims(space.get()))));
  H5Sget_simple_extent_dims(space.get(), reinterpret_cast<hsize_t*>(shape.data()), nullptr);
  return shape;
}

/// Memory and file spaces of rows `first` to `first + rows` of a dataset.
std::pair<Id, Id> select_rows(const Id& dataset, std::uint64_t first, std::uint64_t rows) {
  Id space(H5Dget_space(dataset.get()));
  Shape count = shape_of(dataset), start(count.size(), 0);
  start[0] = first;
  count[0] = rows;
  Id memory(H5Screate_simple(static_cast<int>(count.size()), dims(count), nullptr));
  require_memory(H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, dims(start), nullptr, dims(count), nullptr));
  return {std::move(memory), std::move(space)};
}

/// False on errors.
bool write_rows(const Id& dataset, Type type, std::uint64_t first, std::uint64_t rows, const void* values) {
  const auto [memory, space] = select_rows(dataset, first, rows);
  return H5Dwrite(dataset.get(), native(type), memory.get(), space.get(), H5P_DEFAULT, values) >= 0;
}

/// The bytes of a single value, as a text of fixed length; nothing if they cannot be read.
std::optional<std::string> read_single(const Id& dataset) {
  const Id type(H5Dget_type(dataset.get()));
  if (!shape_of(dataset).empty() || H5Tdetect_class(type.get(), H5T_VLEN) != 0 || H5Tis_variable_str(type.get()) > 0)
    return {};
  std::string bytes(H5Tget_size(type.get()), '\0');
  if (H5Dread(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) < 0) return {};
  return bytes;
}

/// CRC-32 of the first `rows` rows as they are in the file, and of all; nothing if they cannot be read.
std::optional<std::pair<std::uint32_t, std::uint32_t>> crc32_of_rows(const Id& dataset, std::uint64_t rows) {
  constexpr std::uint64_t piece_bytes = 1 << 20;
  const Shape shape = shape_of(dataset);
  const Id type(H5Dget_type(dataset.get()));
  if (shape.empty()) {
    const auto bytes = read_single(dataset);
    if (!bytes) return {};
    return std::pair{0u, crc32_of(std::as_bytes(std::span(*bytes)))};
  }
  const std::uint64_t row_bytes = row_width(shape) * H5Tget_size(type.get());
  if (row_bytes == 0) return std::pair{0u, 0u};
  const std::uint64_t at_once = std::max<std::uint64_t>(1, piece_bytes / row_bytes);
  std::vector<std::byte> piece;
  std::uint32_t of_first = 0, of_all = 0;
  for (std::uint64_t row = 0, count = 0; row < shape[0]; row += count) {
    count = std::min(at_once, (row < rows ? std::min(rows, shape[0]) : shape[0]) - row);
    piece.resize(count * row_bytes);
    const auto [memory, space] = select_rows(dataset, row, count);
    if (H5Dread(dataset.get(), type.get(), memory.get(), space.get(), H5P_DEFAULT, piece.data()) < 0) return {};
    of_all = crc32_of(piece, of_all);
    if (row + count <= rows) of_first = of_all;
  }
  return std::pair{of_first, of_all};
}

/// Creates the groups in the path of a name, as `mkdir -p` does.
hid_t creating_parents() {
  static const hid_t list = lasting(H5P_LINK_CREATE, [](const Id& properties) {
    require_memory(H5Pset_create_intermediate_group(properties.get(), 1));
    require_memory(H5Pset_char_encoding(properties.get(), H5T_CSET_UTF8));
  });
  return list;
}

/// Datasets whose values all get written: with their space in the file at once, so that ranks can write to it.
hid_t written_whole() {
  static const hid_t list = lasting(H5P_DATASET_CREATE, [](const Id& properties) {
    require_memory(H5Pset_fill_time(properties.get(), H5D_FILL_TIME_NEVER));
    require_memory(H5Pset_alloc_time(properties.get(), H5D_ALLOC_TIME_EARLY));
  });
  return list;
}

/// Names of the links of a group; nothing where they cannot be read.
std::optional<std::vector<std::string>> names_in(const Id& group) {
  Names found;
  const auto visit = [](hid_t, const char* name, const H5L_info_t*, void* to) { return Names::add(to, name); };
  const bool failed = H5Literate(group.get(), H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, visit, &found) < 0;
  std::vector<std::string> names = found.take();
  if (failed) return {};
  return names;
}

}  // namespace

std::size_t size_of(Type type) { return H5Tget_size(native(type)); }

bool can_deflate() {
  unsigned info = 0;
  return H5Zfilter_avail(H5Z_FILTER_DEFLATE) > 0 && H5Zget_filter_info(H5Z_FILTER_DEFLATE, &info) >= 0 &&
         (info & H5Z_FILTER_CONFIG_ENCODE_ENABLED) != 0;
}

std::uint64_t row_width(const Shape& shape) { return product(std::span(shape).subspan(1)); }

std::string library_version() {
  unsigned major = 0, minor = 0, release = 0;
  H5get_libversion(&major, &minor, &release);
  return fmt::format("{}.{}.{}", major, minor, release);
}

Id::~Id() {
  if (id_ < 0) return;
  // Closing clears HDF5's error stack, which may still be needed for the message about the call before.
  const hid_t errors = H5Eget_num(H5E_DEFAULT) > 0 ? H5Eget_current_stack() : H5I_INVALID_HID;
  {
    const Quiet quiet;
    H5Idec_ref(id_);
  }
  if (errors >= 0) H5Eset_current_stack(errors);
}

// ---- groups ----------------------------------------------------------------------------------------------------

std::string Group::full(const std::string& name) const {
  if (name.empty() || name.starts_with('/')) return name.empty() ? path_ : name;
  return path_ + (path_.ends_with('/') ? "" : "/") + name;
}

void Group::fail_read(const std::string& name) const {
  check_memory(full(name), file_);
  const std::string why = reason();
  throw InputError("cannot read {} of {}: {}; is the file whole, and written by this version?", full(name), file_, why);
}

void Group::fail_write(const std::string& name) const { fail_to_write(full(name), file_); }

Group Group::create_group(const std::string& name) {
  if (recorded_) {
    const auto made = std::make_shared<Recorded>();
    recorded_->put(name, made);
    return {made, file_, full(name)};
  }
  const Quiet quiet;
  Id group(H5Gcreate2(id_.get(), name.c_str(), creating_parents(), few_links(), H5P_DEFAULT));
  if (!group.valid()) fail_write(name);
  return {std::move(group), file_, full(name)};
}

Group Group::open_group(const std::string& name) const {
  if (recorded_) return {recorded_->find(name), file_, full(name)};
  const Quiet quiet;
  Id group(H5Gopen2(id_.get(), name.c_str(), H5P_DEFAULT));
  if (!group.valid()) fail_read(name);
  return {std::move(group), file_, full(name)};
}

Group Group::create_unlinked_group() {
  if (recorded_) return {std::make_shared<Recorded>(), file_, full("(new group)")};
  const Quiet quiet;
  Id group(H5Gcreate_anon(id_.get(), few_links(), H5P_DEFAULT));
  if (!group.valid()) fail_write("(new group)");
  return {std::move(group), file_, full("(new group)")};
}

void Group::link(const Group& group, const std::string& name) {
  if (recorded_) return recorded_->put(name, group.recorded_);
  if (has(name)) remove(name);
  const Quiet quiet;
  if (H5Olink(group.id_.get(), id_.get(), name.c_str(), creating_parents(), H5P_DEFAULT) < 0) fail_write(name);
}

void Group::link(const std::string& existing, const std::string& name) {
  if (recorded_) return recorded_->put(name, recorded_->find(existing));
  const Quiet quiet;
  if (H5Lcreate_hard(id_.get(), existing.c_str(), id_.get(), name.c_str(), creating_parents(), H5P_DEFAULT) < 0)
    fail_write(name);
}

bool Group::has_group(const std::string& name) const {
  const Quiet quiet;
  return has(name) && Id(H5Gopen2(id_.get(), name.c_str(), H5P_DEFAULT)).valid();
}

bool Group::has(const std::string& name) const {
  if (recorded_) return recorded_->find(name) != nullptr;
  const Quiet quiet;
  // In HDF5 a query of a/b without a group a is an error.
  for (std::size_t end = name.find('/', 1); end != name.npos; end = name.find('/', end + 1))
    if (H5Lexists(id_.get(), name.substr(0, end).c_str(), H5P_DEFAULT) <= 0) return false;
  const htri_t exists = H5Lexists(id_.get(), name.c_str(), H5P_DEFAULT);
  if (exists < 0) fail_read(name);
  return exists > 0;
}

std::vector<std::string> Group::links() const {
  const Quiet quiet;
  std::optional<std::vector<std::string>> names = names_in(id_);
  if (!names) fail_read("");
  std::sort(names->begin(), names->end());
  return *std::move(names);
}

void Group::remove(const std::string& name) {
  const Quiet quiet;
  if (H5Ldelete(id_.get(), name.c_str(), H5P_DEFAULT) < 0) fail_write(name);
}

// ---- datasets --------------------------------------------------------------------------------------------------

namespace {

/// The attribute with the CRC-32 of a dataset; invalid on errors.
Id new_crc32(const Id& dataset, std::uint32_t value) {
  Id attribute(H5Acreate2(dataset.get(), crc32_name, H5T_NATIVE_UINT32, scalar(), H5P_DEFAULT, H5P_DEFAULT));
  if (attribute.valid() && H5Awrite(attribute.get(), H5T_NATIVE_UINT32, &value) < 0) return {};
  return attribute;
}

}  // namespace

Id Group::new_dataset(const std::string& name, Type type, const Shape& shape, std::int64_t properties) {
  const Quiet quiet;
  const Id space(H5Screate_simple(static_cast<int>(shape.size()), dims(shape), nullptr));
  Id dataset(
      H5Dcreate2(id_.get(), name.c_str(), native(type), space.get(), creating_parents(), properties, H5P_DEFAULT));
  if (!dataset.valid()) fail_write(name);
  return dataset;
}

namespace {

/// Chunks of about 64 KiB. Their index has the format of HDF5 1.10, because an index of 1.8 takes 2 KiB even for a
/// single chunk.
constexpr std::uint64_t chunk_bytes = 1 << 16;

void compress(const Id& properties, Type type, const Shape& shape, int level) {
  Shape chunk = shape;
  chunk[0] = std::clamp<std::uint64_t>(chunk_bytes / (row_width(shape) * size_of(type)), 1, shape[0]);
  require_memory(H5Pset_chunk(properties.get(), static_cast<int>(chunk.size()), dims(chunk)));
  require_memory(H5Pset_shuffle(properties.get()));
  require_memory(H5Pset_deflate(properties.get(), static_cast<unsigned>(level)));
}

/// Within a scope, objects in the file of an object get the format of HDF5 1.10.
class LaterFormat {
 public:
  explicit LaterFormat(const Id& object) : file_(H5Iget_file_id(object.get())) { set(H5F_LIBVER_V110); }
  ~LaterFormat() { set(H5F_LIBVER_V18); }
  LaterFormat(const LaterFormat&) = delete;
  LaterFormat& operator=(const LaterFormat&) = delete;

 private:
  void set(H5F_libver_t least) const { H5Fset_libver_bounds(file_.get(), least, H5F_LIBVER_LATEST); }
  Id file_;
};

}  // namespace

Dataset Group::create_dataset(const std::string& name, Type type, const Shape& shape, int deflate) {
  if (recorded_) {
    const auto made = std::make_shared<Recorded>(
        Recorded{.kind = Recorded::Kind::dataset, .type = type, .shape = shape, .deflate = deflate});
    made->bytes.resize(product(shape) * size_of(type));
    recorded_->put(name, made);
    return Dataset(made);
  }
  const Quiet quiet;
  if (deflate == 0 || product(shape) == 0)
    return {new_dataset(name, type, shape, written_whole()), type, file_, full(name)};
  const Id properties(H5Pcreate(H5P_DATASET_CREATE));
  require_memory(H5Pset_fill_time(properties.get(), H5D_FILL_TIME_NEVER));
  const LaterFormat later(id_);
  compress(properties, type, shape, deflate);
  return {new_dataset(name, type, shape, properties.get()), type, file_, full(name)};
}

void Group::write_view(const std::string& name, const View& view) {
  Shape from(view.source_shape.size(), 0), taken = view.source_shape, to(view.shape.size(), 0), filled = view.shape;
  if (taken.size() > 1) taken[1] = view.columns;
  if (filled.size() > 1) {
    to[1] = view.first;
    filled[1] = product(taken) / filled[0];
  }
  const Quiet quiet;
  const auto space_of = [](const Shape& shape) {
    return Id(H5Screate_simple(static_cast<int>(shape.size()), dims(shape), nullptr));
  };
  const Id properties(H5Pcreate(H5P_DATASET_CREATE)), shown = space_of(view.shape),
                                                      source = space_of(view.source_shape);
  if (H5Sselect_hyperslab(shown.get(), H5S_SELECT_SET, dims(to), nullptr, dims(filled), nullptr) < 0 ||
      H5Sselect_hyperslab(source.get(), H5S_SELECT_SET, dims(from), nullptr, dims(taken), nullptr) < 0 ||
      H5Pset_virtual(properties.get(), shown.get(), ".", view.source.c_str(), source.get()) < 0)
    fail_write(name);
  new_dataset(name, view.type, view.shape, properties.get());
}

Dataset::Dataset(std::shared_ptr<Recorded> recorded) : recorded_(std::move(recorded)), type_(recorded_->type) {}

void Dataset::write(std::uint64_t first, std::uint64_t rows, const void* values) {
  if (recorded_) {
    const std::size_t row = row_width(recorded_->shape) * size_of(type_);
    recorded_->bytes.replace(first * row, rows * row, static_cast<const char*>(values), rows * row);
    return;
  }
  const Quiet quiet;
  if (rows > 0 && !write_rows(id_, type_, first, rows, values)) fail_to_write(path_, file_);
}

void Dataset::set_crc32(std::uint32_t value) {
  if (recorded_) {
    recorded_->crc32 = value;
    return;
  }
  const Quiet quiet;
  if (!new_crc32(id_, value).valid()) fail_to_write(path_, file_);
}

std::uint64_t Dataset::address() const {
  if (recorded_) return 0;
  const haddr_t address = H5Dget_offset(id_.get());
  return address == HADDR_UNDEF ? 0 : address;
}

void Group::write_values(const std::string& name, Type type, const void* values, std::size_t count, const Shape& shape,
                         Storage storage) {
  if (product(shape) != count)
    throw std::invalid_argument(fmt::format("{}: {} values do not fill the shape {}", full(name), count, text(shape)));
  std::optional<std::uint32_t> sum;
  if (storage == Storage::crc32) sum = crc32_of({static_cast<const std::byte*>(values), count * size_of(type)});
  write_whole(name, type, values, shape, sum);
}

void Group::write_whole(const std::string& name, Type type, const void* values, const Shape& shape,
                        std::optional<std::uint32_t> sum) {
  if (recorded_) {
    const std::string_view bytes(static_cast<const char*>(values), product(shape) * size_of(type));
    recorded_->put(
        name,
        std::make_shared<Recorded>(Recorded{
            .kind = Recorded::Kind::dataset, .type = type, .shape = shape, .bytes = std::string(bytes), .crc32 = sum}));
    return;
  }
  const Id dataset = new_dataset(name, type, shape, H5P_DEFAULT);
  const Quiet quiet;
  if (product(shape) > 0 && H5Dwrite(dataset.get(), native(type), H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0)
    fail_write(name);
  if (sum && !new_crc32(dataset, *sum).valid()) fail_write(name);
}

void Group::write_fill_value(const std::string& name, Type type, const void* value, const Shape& shape) {
  if (recorded_)
    return recorded_->put(
        name, std::make_shared<Recorded>(Recorded{.kind = Recorded::Kind::constant,
                                                  .type = type,
                                                  .shape = shape,
                                                  .bytes = {static_cast<const char*>(value), size_of(type)}}));
  const Quiet quiet;
  static std::map<std::pair<Type, std::string>, hid_t> lists;  // constants have few different values
  hid_t& list = lists.try_emplace({type, {static_cast<const char*>(value), size_of(type)}}, H5P_DEFAULT).first->second;
  if (list == H5P_DEFAULT)
    list = lasting(H5P_DATASET_CREATE, [&](const Id& properties) {
      require_memory(H5Pset_fill_value(properties.get(), native(type), value));
    });
  new_dataset(name, type, shape, list);
}

Shape Group::shape(const std::string& name) const {
  if (recorded_) return recorded_->find(name)->shape;
  const Quiet quiet;
  const Id dataset(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT));
  if (!dataset.valid()) fail_read(name);
  return shape_of(dataset);
}

Shape Group::checked_shape(const std::string& name, const Shape& expected) const {
  Shape found = shape(name);
  const auto fits = [](std::uint64_t a, std::uint64_t b) { return b == any_length || a == b; };
  if (!std::equal(found.begin(), found.end(), expected.begin(), expected.end(), fits))
    throw InputError("{} of {} has the shape {} instead of {}; is it the file of another run?", full(name), file_,
                     text(found), text(expected));
  return found;
}

bool Group::holds_integers(const std::string& name) const {
  const Quiet quiet;
  const Id dataset(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT));
  if (!dataset.valid()) fail_read(name);
  return H5Tget_class(Id(H5Dget_type(dataset.get())).get()) == H5T_INTEGER;
}

std::size_t Group::value_size(const std::string& name) const {
  const Quiet quiet;
  const Id dataset(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT));
  if (!dataset.valid()) fail_read(name);
  return H5Tget_size(Id(H5Dget_type(dataset.get())).get());
}

void Group::read_values(const std::string& name, Type type, void* values) const {
  if (type != Type::real && !holds_integers(name))
    throw InputError("{} of {} does not hold integers; is the file written by this version?", full(name), file_);
  const Quiet quiet;
  const Id dataset(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT));
  if (!dataset.valid() || H5Dread(dataset.get(), native(type), H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0)
    fail_read(name);
}

void Group::check(const std::string& name) const {
  const Quiet quiet;
  const Id dataset(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT));
  if (!dataset.valid()) fail_read(name);
  check(name, dataset, 0);
}

/// CRC-32 of the first `rows` rows of a dataset that is whole.
std::uint32_t Group::check(const std::string& name, const Id& dataset, std::uint64_t rows) const {
  const Id attribute(H5Aopen(dataset.get(), crc32_name, H5P_DEFAULT));
  std::uint32_t stored = 0;
  if (!attribute.valid() || H5Aread(attribute.get(), H5T_NATIVE_UINT32, &stored) < 0)
    throw InputError("{} of {} has no checksum that can be read; is the file whole, and written by this version?",
                     full(name), file_);
  const auto found = crc32_of_rows(dataset, rows);
  if (!found) fail_read(name);
  if (found->second != stored)
    throw InputError("{} of {} is damaged: its values have the CRC-32 {:08x} instead of {:08x}", full(name), file_,
                     found->second, stored);
  return found->first;
}

void Group::write_text(const std::string& name, const std::string& text) {
  if (recorded_)
    return recorded_->put(name, std::make_shared<Recorded>(Recorded{.kind = Recorded::Kind::text, .bytes = text}));
  const Quiet quiet;
  std::string bytes = text;
  bytes.resize(std::max<std::size_t>(bytes.size(), 1), '\0');  // HDF5 has no strings of length 0
  const Id type(H5Tcopy(H5T_C_S1));
  require_memory(H5Tset_size(type.get(), bytes.size()));
  require_memory(H5Tset_strpad(type.get(), H5T_STR_NULLPAD));
  require_memory(H5Tset_cset(type.get(), H5T_CSET_UTF8));
  const Id dataset(
      H5Dcreate2(id_.get(), name.c_str(), type.get(), scalar(), creating_parents(), H5P_DEFAULT, H5P_DEFAULT));
  if (!dataset.valid() || H5Dwrite(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) < 0 ||
      !new_crc32(dataset, crc32_of(std::as_bytes(std::span(bytes)))).valid())
    fail_write(name);
}

std::string Group::read_text(const std::string& name) const {
  check(name);
  const Quiet quiet;
  const Id dataset(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT));
  auto text = read_single(dataset);
  if (!text || H5Tget_class(Id(H5Dget_type(dataset.get())).get()) != H5T_STRING) fail_read(name);
  text->resize(text->find_last_not_of('\0') + 1);
  return *std::move(text);
}

Rows Group::create_rows(const std::string& name, const Shape& row, std::uint64_t rows_per_chunk) {
  const Quiet quiet;
  Shape first{0}, most{H5S_UNLIMITED}, chunk{rows_per_chunk};
  for (Shape* shape : {&first, &most, &chunk}) shape->insert(shape->end(), row.begin(), row.end());
  const Id space(H5Screate_simple(static_cast<int>(first.size()), dims(first), dims(most)));
  const Id properties(H5Pcreate(H5P_DATASET_CREATE));
  require_memory(H5Pset_chunk(properties.get(), static_cast<int>(chunk.size()), dims(chunk)));
  Id dataset(H5Dcreate2(id_.get(), name.c_str(), H5T_NATIVE_DOUBLE, space.get(), creating_parents(), properties.get(),
                        H5P_DEFAULT));
  if (!dataset.valid()) fail_write(name);
  Rows rows(std::move(dataset), first, file_, full(name));
  rows.attribute_ = new_crc32(rows.dataset_, 0);
  if (!rows.attribute_.valid()) fail_write(name);
  return rows;
}

Rows Group::open_rows(const std::string& name, std::uint64_t rows) {
  Shape whole = shape(name);
  if (whole.empty() || whole[0] < rows)
    throw InputError("{} of {} has the shape {} and so cannot be cut to {} rows; is it the file of another run?",
                     full(name), file_, text(whole), rows);
  const Quiet quiet;
  Id dataset(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT));
  if (!dataset.valid()) fail_read(name);
  const std::uint32_t sum = check(name, dataset, rows);
  const bool longer = whole[0] > rows;
  whole[0] = rows;
  Rows opened(std::move(dataset), whole, file_, full(name));
  opened.crc32_ = sum;
  opened.attribute_ = Id(H5Aopen(opened.dataset_.get(), crc32_name, H5P_DEFAULT));
  if (longer && (H5Dset_extent(opened.dataset_.get(), dims(whole)) < 0 ||
                 H5Awrite(opened.attribute_.get(), H5T_NATIVE_UINT32, &sum) < 0))
    fail_write(name);
  return opened;
}

void Rows::append(std::span<const double> values) {
  const std::uint64_t width = row_width(shape_), first = shape_[0];
  if (width == 0 || values.size() % width != 0)
    throw std::invalid_argument(
        fmt::format("{}: {} values do not divide into rows of {}", path_, values.size(), width));
  const std::uint64_t count = values.size() / width;
  shape_[0] += count;
  crc32_ = crc32_of(std::as_bytes(values), crc32_);
  const Quiet quiet;
  if (H5Dset_extent(dataset_.get(), dims(shape_)) < 0 ||
      !write_rows(dataset_, Type::real, first, count, values.data()) ||
      H5Awrite(attribute_.get(), H5T_NATIVE_UINT32, &crc32_) < 0)
    fail_to_write(path_, file_);
}

// ---- attributes ------------------------------------------------------------------------------------------------

namespace {

/// Replaces the attribute; returns an invalid Id on errors.
Id new_attribute(hid_t object, const std::string& name, hid_t type) {
  const htri_t exists = H5Aexists(object, name.c_str());
  if (exists < 0 || (exists > 0 && H5Adelete(object, name.c_str()) < 0)) return {};
  return Id(H5Acreate2(object, name.c_str(), type, scalar(), H5P_DEFAULT, H5P_DEFAULT));
}

/// Whether there is such an attribute, of one value.
bool is_single(const Id& attribute) {
  return attribute.valid() && H5Sget_simple_extent_npoints(Id(H5Aget_space(attribute.get())).get()) == 1;
}

/// Nothing if the dataset is not a string of variable length, or cannot be read.
std::optional<std::string> read_string(hid_t object, const std::string& name) {
  const Id attribute(H5Aopen(object, name.c_str(), H5P_DEFAULT));
  if (!is_single(attribute)) return {};
  const Id type(H5Aget_type(attribute.get()));
  if (H5Tis_variable_str(type.get()) <= 0) return {};
  char* value = nullptr;
  if (H5Aread(attribute.get(), string_type().get(), &value) < 0) return {};
  std::string copy = value != nullptr ? value : "";
  H5free_memory(value);
  return copy;
}

}  // namespace

void Group::set_attribute(const std::string& name, const std::string& value) {
  const Quiet quiet;
  const Id type = string_type();
  const Id attribute = new_attribute(id_.get(), name, type.get());
  const char* pointer = value.c_str();
  if (!attribute.valid() || H5Awrite(attribute.get(), type.get(), &pointer) < 0) fail_write("attribute " + name);
}

void Group::set_number(const std::string& name, Type type, const void* value) {
  if (recorded_) return recorded_->set_attribute(name, type, value);
  const Quiet quiet;
  // Overwritten in place: a new attribute would enlarge the group's header.
  const Id attribute = H5Aexists(id_.get(), name.c_str()) > 0 ? Id(H5Aopen(id_.get(), name.c_str(), H5P_DEFAULT))
                                                              : new_attribute(id_.get(), name, native(type));
  if (!attribute.valid() || H5Awrite(attribute.get(), native(type), value) < 0) fail_write("attribute " + name);
}

void Group::set_attribute(const std::string& name, double value) { set_number(name, Type::real, &value); }
void Group::set_attribute(const std::string& name, std::int64_t value) { set_number(name, Type::int64, &value); }

void Group::read_number(const std::string& name, Type type, void* value) const {
  const Quiet quiet;
  const Id attribute(H5Aopen(id_.get(), name.c_str(), H5P_DEFAULT));
  if (!is_single(attribute) || H5Aread(attribute.get(), native(type), value) < 0) fail_read("attribute " + name);
}

double Group::real_attribute(const std::string& name) const {
  double value = 0;
  read_number(name, Type::real, &value);
  return value;
}

std::int64_t Group::integer_attribute(const std::string& name) const {
  std::int64_t value = 0;
  read_number(name, Type::int64, &value);
  return value;
}

std::string Group::string_attribute(const std::string& name) const {
  const Quiet quiet;
  auto value = read_string(id_.get(), name);
  if (!value) fail_read("attribute " + name);
  return *std::move(value);
}

std::map<std::string, std::string> Group::string_attributes() const {
  const Quiet quiet;
  Names found;
  const auto visit = [](hid_t, const char* name, const H5A_info_t*, void* to) { return Names::add(to, name); };
  const bool failed = H5Aiterate2(id_.get(), H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, visit, &found) < 0;
  const std::vector<std::string> names = found.take();
  if (failed) fail_read("attributes");
  std::map<std::string, std::string> values;
  for (const std::string& name : names)
    if (auto value = read_string(id_.get(), name)) values.emplace(name, *std::move(value));
  return values;
}

void Group::count_members() {
  if (recorded_) return set_attribute(members_name, static_cast<std::int64_t>(recorded_->members.size()));
  H5G_info_t info{};
  {
    const Quiet quiet;
    if (H5Gget_info(id_.get(), &info) < 0) fail_read("");
  }
  set_attribute(members_name, static_cast<std::int64_t>(info.nlinks));
}

std::vector<std::string> Group::datasets() const {
  const Quiet quiet;
  Names found;
  const auto visit = [](hid_t group, const char* name, const H5O_info_t* object, void* to) -> herr_t {
    // Views have no checksum. HDF5 1.10 dies if it opens one whose description is damaged, because it compares the
    // checksum of the description last.
    if (object->type != H5O_TYPE_DATASET || object->rc > 1 || object->num_attrs == 0) return 0;
    const Id dataset(H5Dopen2(group, name, H5P_DEFAULT));
    if (!dataset.valid()) return -1;
    return H5Dget_storage_size(dataset.get()) > 0 ? Names::add(to, name) : 0;
  };
  const bool failed =
      H5Ovisit2(id_.get(), H5_INDEX_NAME, H5_ITER_NATIVE, visit, &found, H5O_INFO_BASIC | H5O_INFO_NUM_ATTRS) < 0;
  std::vector<std::string> names = found.take();
  if (failed) fail_read("");
  std::sort(names.begin(), names.end());
  return names;
}

// ---- files -----------------------------------------------------------------------------------------------------

File::File(Id file, std::string name, std::unique_ptr<JournaledFile> disk)
    : Group(Id(), std::move(name), "/"), disk_(std::move(disk)), file_id_(std::move(file)) {
  id_ = Id(H5Gopen2(file_id_.get(), "/", H5P_DEFAULT));
}

File::File(std::string name) : Group(std::make_shared<Recorded>(), std::move(name), "/") {}

/// A write that has failed may have left HDF5 with half of it, which must not be committed.
File::~File() { abandon(); }

void File::abandon() {
  const Quiet quiet;
  if (disk_) disk_->abandon();
  id_ = Id();
  // HDF5 keeps a file that it cannot close open, and closes it at the end of the program: then the driver must still
  // exist.
  if (file_id_.valid() && H5Fclose(file_id_.release()) < 0) (void)disk_.release();
  disk_.reset();
}

File File::create(const std::filesystem::path& path) {
  const Quiet quiet;
  auto disk = std::make_unique<JournaledFile>(JournaledFile::create(path));
  Id file(H5Fcreate(path.c_str(), H5F_ACC_EXCL, new_file_on_disk().get(), disk_access(*disk).get()));
  if (!file.valid()) throw OutputError("cannot create {}: {}", path.string(), reason());
  return {std::move(file), path.string(), std::move(disk)};
}

File File::in_memory(const std::string& name) {
  const Quiet quiet;
  const Id access = file_access();
  require_memory(H5Pset_fapl_core(access.get(), memory_step, false));
  Id file(H5Fcreate(name.c_str(), H5F_ACC_TRUNC, new_file().get(), access.get()));
  if (!file.valid()) throw OutputError("cannot prepare {} in memory: {}", name, reason());
  return {std::move(file), name, nullptr};
}

File File::recorder(const std::string& name) { return File(name); }
std::string File::recorded() const { return recorded_->message(); }

File File::open(JournaledFile opened, const std::filesystem::path& path, bool writable) {
  const Quiet quiet;
  auto disk = std::make_unique<JournaledFile>(std::move(opened));
  Id id(H5Fopen(path.c_str(), writable ? H5F_ACC_RDWR : H5F_ACC_RDONLY, disk_access(*disk).get()));
  if (!id.valid())
    throw InputError("cannot open {}: {}; is it a whole HDF5 file that no other program uses?", path.string(),
                     reason());
  if (writable) disk->cut(allocated_end(id.get()));
  File file(std::move(id), path.string(), std::move(disk));
  file.writable_ = writable;
  return file;
}

File File::open_read(const std::filesystem::path& path) { return open(JournaledFile::open_read(path), path, false); }
File File::open_write(const std::filesystem::path& path) { return open(JournaledFile::open_write(path), path, true); }

void File::rename(const std::filesystem::path& path) {
  disk_->rename(path);
  file_ = path.string();
}

void File::keep_little_metadata() {
  constexpr std::size_t bytes = 1 << 16;  // fits into the second-level cache
  H5AC_cache_config_t cache{};
  cache.version = H5AC__CURR_CACHE_CONFIG_VERSION;
  require_memory(H5Fget_mdc_config(file_id_.get(), &cache));
  cache.set_initial_size = true;
  cache.initial_size = cache.min_size = cache.max_size = bytes;
  cache.incr_mode = H5C_incr__off;
  cache.flash_incr_mode = H5C_flash_incr__off;
  cache.decr_mode = H5C_decr__off;
  require_memory(H5Fset_mdc_config(file_id_.get(), &cache));
}

void File::flush() {
  if (recorded_) return;
  const Quiet quiet;
  if (H5Fflush(file_id_.get(), H5F_SCOPE_GLOBAL) < 0) fail_write("");
  if (disk_) disk_->commit(allocated_end(file_id_.get()));
}

void File::close() {
  recorded_.reset();
  if (!file_id_.valid()) return;
  try {
    if (writable_) flush();
  } catch (...) {
    abandon();
    throw;
  }
  abandon();
}

std::string_view File::image() {
  flush();
  const Quiet quiet;
  // HDF5 would copy the image; its driver for files in memory hands out where it is.
  void* handle = nullptr;
  const ssize_t size = H5Fget_file_image(file_id_.get(), nullptr, 0);
  if (size < 0 || H5Fget_vfd_handle(file_id_.get(), H5P_DEFAULT, &handle) < 0) fail_write("");
  return {*static_cast<char**>(handle), static_cast<std::size_t>(size)};
}

}  // namespace pliant::hdf5
