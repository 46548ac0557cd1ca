#include <fmt/format.h>
#include <pliant/base/errors.h>
#include <pliant/base/regular_file.h>
#include <pliant/base/text.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace pliant {
namespace {

// Length of the first character of the text; 0 if it is invalid UTF-8 or a control character.
std::size_t plain_character(std::string_view text) {
  const auto byte = [&](std::size_t i) -> unsigned {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0;
  };
  const unsigned first = byte(0);
  if (first < 0x80) return first >= 0x20 && first != 0x7f ? 1 : 0;
  const std::size_t length = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4) return 0;
  for (std::size_t i = 1; i < length; ++i)
    if ((byte(i) & 0xc0) != 0x80) return 0;
  const bool overlong = (first == 0xe0 && byte(1) < 0xa0) || (first == 0xf0 && byte(1) < 0x90);
  const bool surrogate = first == 0xed && byte(1) > 0x9f, too_large = first == 0xf4 && byte(1) > 0x8f;
  const bool control = first == 0xc2 && byte(1) < 0xa0;
  return overlong || surrogate || too_large || control ? 0 : length;
}

std::string escaped(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t length = plain_character(text);
    if (length == 0)
      result += fmt::format("\\x{:02x}", static_cast<unsigned char>(text[0]));
    else
      result += text.substr(0, length);
    text.remove_prefix(std::max<std::size_t>(length, 1));
  }
  return result;
}

}  // namespace

bool is_plain_text(std::string_view text) {
  while (!text.empty()) {
    const std::size_t length = plain_character(text);
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

std::string printable(std::string_view text) {
  constexpr std::size_t longest = 300, end = 50;
  if (text.size() <= longest) return escaped(text);
  return fmt::format("{} … {} ({} bytes)", escaped(text.substr(0, end)), escaped(text.substr(text.size() - end)),
                     text.size());
}

std::string alternatives(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t k = 0; k < names.size(); ++k)
    text += (k == 0 ? "" : k + 1 < names.size() ? ", " : " or ") + names[k];
  return text;
}

std::string read_text_file(const std::string& file, std::size_t limit, std::string_view what) {
  const std::string name = printable(file);
  const int in = open_readable(file, what);
  if (in < 0) throw InputError("{} {}: cannot be opened: {}", what, name, std::strerror(errno));
  std::string text;
  constexpr std::size_t piece = 1 << 16;
  ssize_t got = 1;
  while (got != 0 && text.size() <= limit) {
    const std::size_t before = text.size();
    text.resize(before + piece);
    got = read_some(in, text.data() + before, piece);
    if (got < 0) break;
    text.resize(before + static_cast<std::size_t>(got));
  }
  const int error = got < 0 ? errno : 0;
  ::close(in);
  if (error != 0) throw InputError("{} {}: cannot be read: {}", what, name, std::strerror(error));
  if (text.size() > limit) throw InputError("{} {}: is too large; the limit is {} bytes", what, name, limit);
  constexpr std::string_view byte_order_mark = "\xef\xbb\xbf";
  if (text.starts_with(byte_order_mark)) text.erase(0, byte_order_mark.size());
  return text;
}

}  // namespace pliant
