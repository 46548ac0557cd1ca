// Objects written to a Group without a file, for another process to write into a file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <pliant/io/hdf5.h>

namespace pliant::hdf5 {

/// A group, dataset, constant or text in memory.
struct Recorded {
  enum class Kind : std::uint8_t { group, dataset, constant, text };
  struct Attribute {
    std::string name;
    Type type;
    std::string value;  ///< bytes
  };

  Kind kind = Kind::group;
  Type type = Type::real;
  Shape shape = {};
  std::string bytes = {};  ///< values of a dataset, the value of a constant, or a text
  int deflate = 0;
  std::optional<std::uint32_t> crc32 = {};
  std::vector<Attribute> attributes = {};                                       ///< numbers of a group
  std::vector<std::pair<std::string, std::shared_ptr<Recorded>>> members = {};  ///< objects of a group, in order

  /// The object at a path, which may begin with "/" if this is the root; nothing if there is none.
  std::shared_ptr<Recorded> find(std::string_view path) const;
  /// Names an object, replacing the object of that name; missing groups on the way are created.
  void put(std::string_view path, std::shared_ptr<Recorded> object);
  void set_attribute(const std::string& name, Type type, const void* value);

  /// This group as a message to another process of this program, for Group::add().
  std::string message() const;
};

}  // namespace pliant::hdf5
