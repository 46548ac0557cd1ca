#include <pliant/io/recording.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>
#include <type_traits>

namespace pliant::hdf5 {
namespace {

/// In a message: an object, or a second name of an object.
enum class Entry : std::uint8_t { object, link };

/// More than the bytes of a group in a message.
std::size_t size_in_message(const Recorded& group) {
  constexpr std::size_t others = 256;  // sizes, names
  std::size_t size = others * (1 + group.attributes.size());
  for (const auto& [name, object] : group.members) size += object->bytes.size() + size_in_message(*object);
  return size;
}

class Writer {
 public:
  template <class T>
  void number(T value) {
    static_assert(std::is_trivially_copyable_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void text(std::string_view text) {
    number<std::uint64_t>(text.size());
    bytes_.append(text);
  }
  /// path: of the group, from the root of the message, with "/" at the end.
  void group(const Recorded& group, const std::string& path) {
    number<std::uint64_t>(group.attributes.size());
    for (const Recorded::Attribute& a : group.attributes) {
      text(a.name);
      number(a.type);
      text(a.value);
    }
    number<std::uint64_t>(group.members.size());
    for (const auto& [name, object] : group.members) {
      text(name);
      const auto [first, is_new] = paths_.emplace(object.get(), path + name);
      number(is_new ? Entry::object : Entry::link);
      if (!is_new)
        text(first->second);
      else
        write(*object, path + name + "/");
    }
  }
  void reserve(std::size_t bytes) { bytes_.reserve(bytes); }
  std::string take() { return std::move(bytes_); }

 private:
  void write(const Recorded& o, const std::string& path) {
    number(o.kind);
    if (o.kind == Recorded::Kind::group) return group(o, path);
    number(o.type);
    number<std::uint64_t>(o.shape.size());
    for (const std::uint64_t length : o.shape) number(length);
    text(o.bytes);
    number(o.deflate);
    number(o.crc32);
  }

  std::string bytes_;
  std::map<const Recorded*, std::string> paths_;
};

}  // namespace

std::shared_ptr<Recorded> Recorded::find(std::string_view path) const {
  if (path.starts_with('/')) path.remove_prefix(1);
  const std::size_t end = std::min(path.find('/'), path.size());
  const auto at =
      std::find_if(members.begin(), members.end(), [&](const auto& m) { return m.first == path.substr(0, end); });
  if (at == members.end()) return {};
  return end == path.size() ? at->second : at->second->find(path.substr(end));
}

void Recorded::put(std::string_view path, std::shared_ptr<Recorded> object) {
  if (path.starts_with('/')) path.remove_prefix(1);
  const std::size_t end = std::min(path.find('/'), path.size());
  const std::string_view name = path.substr(0, end);
  auto at = std::find_if(members.begin(), members.end(), [&](const auto& m) { return m.first == name; });
  if (at == members.end()) at = members.emplace(members.end(), name, nullptr);
  if (end == path.size()) {
    at->second = std::move(object);
    return;
  }
  if (!at->second) at->second = std::make_shared<Recorded>();
  at->second->put(path.substr(end), std::move(object));
}

void Recorded::set_attribute(const std::string& name, Type of, const void* value) {
  std::string copy(static_cast<const char*>(value), size_of(of));
  const auto at = std::find_if(attributes.begin(), attributes.end(), [&](const auto& a) { return a.name == name; });
  if (at == attributes.end())
    attributes.push_back({name, of, std::move(copy)});
  else
    *at = {name, of, std::move(copy)};
}

std::string Recorded::message() const {
  Writer writer;
  writer.reserve(size_in_message(*this));
  writer.group(*this, "");
  return writer.take();
}

/// Writes the objects of a message into a file as it reads them.
class MessageReader {
 public:
  MessageReader(std::string_view bytes, std::string root) : bytes_(bytes), root_(std::move(root)) {}

  void group(Group& to) {
    for (auto count = number<std::uint64_t>(); count > 0; --count) {
      const std::string name(text());
      const auto type = number<Type>();
      to.set_number(name, type, text().data());
    }
    for (auto count = number<std::uint64_t>(); count > 0; --count) {
      const std::string name(text());
      if (number<Entry>() == Entry::link)
        to.link(root_ + std::string(text()), name);
      else
        object(to, name);
    }
  }

 private:
  template <class T>
  T number() {
    T value;
    std::memcpy(&value, bytes_.data(), sizeof value);
    bytes_.remove_prefix(sizeof value);
    return value;
  }
  std::string_view text() {
    const auto size = number<std::uint64_t>();
    const std::string_view text = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return text;
  }
  void object(Group& to, const std::string& name) {
    const auto kind = number<Recorded::Kind>();
    if (kind == Recorded::Kind::group) {
      Group made = to.create_group(name);
      return group(made);
    }
    const auto type = number<Type>();
    Shape shape(number<std::uint64_t>());
    for (std::uint64_t& length : shape) length = number<std::uint64_t>();
    const std::string_view values = text();
    const auto deflate = number<int>();
    const auto crc32 = number<std::optional<std::uint32_t>>();
    if (kind == Recorded::Kind::text) return to.write_text(name, std::string(values));
    if (kind == Recorded::Kind::constant) return to.write_fill_value(name, type, values.data(), shape);
    if (deflate == 0) return to.write_whole(name, type, values.data(), shape, crc32);
    Dataset made = to.create_dataset(name, type, shape, deflate);
    if (!values.empty()) made.write(0, shape[0], values.data());
    if (crc32) made.set_crc32(*crc32);
  }

  std::string_view bytes_;
  std::string root_;  ///< path of the group in the file, with "/" at the end
};

void Group::add(std::string_view message) { MessageReader(message, full("") + "/").group(*this); }

}  // namespace pliant::hdf5
