// JSON files that the program writes and reads again: objects with a checksum.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

namespace pliant {

/// Writes an object atomically, between the members "format": 2 and, as the last one, "crc32": the CRC-32 of all bytes
/// before that name. Errors: OutputError.
void write_json(const std::filesystem::path& path, const nlohmann::ordered_json& object);

/// The object without these two; null where there is no file. Files of older versions lack both and are not checked.
/// Errors: InputError if the file cannot be read, is not a JSON object, or has another checksum.
nlohmann::ordered_json read_json(const std::filesystem::path& path);

}  // namespace pliant
