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

class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}
  Recorded root() {
    group(root_);
    return std::move(root_);
  }

 private:
  template <class T>
  T number() {
    T value;
    std::memcpy(&value, bytes_.data(), sizeof value);
    bytes_.remove_prefix(sizeof value);
    return value;
  }
  std::string text() {
    const auto size = number<std::uint64_t>();
    std::string text(bytes_.substr(0, size));
    bytes_.remove_prefix(size);
    return text;
  }
  void group(Recorded& group) {
    for (auto count = number<std::uint64_t>(); count > 0; --count) {
      std::string name = text();
      const auto type = number<Type>();
      group.attributes.push_back({std::move(name), type, text()});
    }
    for (auto count = number<std::uint64_t>(); count > 0; --count) {
      const std::string name = text();
      if (number<Entry>() == Entry::link) {
        group.put(name, root_.find(text()));
      } else {
        const auto object = std::make_shared<Recorded>();
        group.put(name, object);
        read(*object);
      }
    }
  }
  void read(Recorded& o) {
    o.kind = number<Recorded::Kind>();
    if (o.kind == Recorded::Kind::group) return group(o);
    o.type = number<Type>();
    o.shape.resize(number<std::uint64_t>());
    for (std::uint64_t& length : o.shape) length = number<std::uint64_t>();
    o.bytes = text();
    o.deflate = number<int>();
    o.crc32 = number<std::optional<std::uint32_t>>();
  }

  std::string_view bytes_;
  Recorded root_;
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
  writer.group(*this, "");
  return writer.take();
}

Recorded Recorded::from(std::string_view message) { return Reader(message).root(); }

}  // namespace pliant::hdf5
