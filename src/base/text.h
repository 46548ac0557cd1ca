// Text from outside: files within a size limit, and text that can be shown.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace pliant {

/// Whether it is UTF-8 without control characters.
bool is_plain_text(std::string_view text);

/// The text for a message of one line: bytes that are not plain text as `\xNN`, the middle of a long text omitted.
std::string printable(std::string_view text);

/// "a", "a or b", "a, b or c".
std::string alternatives(const std::vector<std::string>& names);

/// The content of a file or a shell's pipe, which is called `what` in messages ("options file"), without a byte order
/// mark of UTF-8. Errors: InputError if it is something else, cannot be read, or has more than `limit` bytes.
std::string read_text_file(const std::string& file, std::size_t limit, std::string_view what);

}  // namespace pliant
