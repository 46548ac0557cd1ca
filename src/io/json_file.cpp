#include <fmt/format.h>
#include <pliant/base/errors.h>
#include <pliant/base/text.h>
#include <pliant/io/atomic_file.h>
#include <pliant/io/crc32.h>
#include <pliant/io/json_file.h>

#include <span>
#include <string>
#include <system_error>

namespace pliant {
namespace {

using nlohmann::ordered_json;

constexpr const char *format_name = "format", *checksum_name = "crc32";
constexpr int sealed_format = 2;
constexpr std::size_t largest_file = std::size_t{64} << 20;

/// The last member, behind `text`.
std::string seal_of(std::string_view text) {
  return fmt::format("\"{}\": \"{:08x}\"\n}}\n", checksum_name, crc32_of(std::as_bytes(std::span(text))));
}

bool is_sealed(std::string_view text) {
  const auto at = text.rfind(fmt::format("\"{}\"", checksum_name));
  return at != text.npos && text.substr(at) == seal_of(text.substr(0, at));
}

}  // namespace

void write_json(const std::filesystem::path& path, const ordered_json& object) {
  ordered_json whole{{format_name, sealed_format}};
  whole.update(object);
  // A message may hold bytes that are not UTF-8 (a file name): replace them rather than lose the file.
  std::string text = whole.dump(2, ' ', false, ordered_json::error_handler_t::replace);
  text.resize(text.size() - 2);  // "\n}"
  text += ",\n  ";
  write_file_atomically(path, {text, seal_of(text)});
}

ordered_json read_json(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error) && !error) return {};
  const std::string text = read_text_file(path.string(), largest_file, "file");
  ordered_json object = ordered_json::parse(text, nullptr, false);
  // Each of the two members marks a file with a checksum: damage cannot hide both.
  const bool sealed = object.contains(format_name) || object.contains(checksum_name);
  if (!object.is_object() || (sealed && !is_sealed(text)))
    throw InputError("{} is damaged or was edited: {}; restore it from a backup, or remove it",
                     printable(path.string()),
                     object.is_object() ? "its checksum does not fit" : "it is not a JSON object");
  object.erase(format_name);
  object.erase(checksum_name);
  return object;
}

}  // namespace pliant
