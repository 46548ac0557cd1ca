// Where options come from: the command line, and options files in PETSc's text format or in YAML.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace pliant {

/// One option as written on the command line or in a file.
struct Setting {
  std::string name;                  ///< without the dash
  std::optional<std::string> value;  ///< nothing for a bare `-name`
  std::string source;                ///< "command line" or the file
  int line = 0;                      ///< in the file, from 1; 0 for the command line
  bool null = false;                 ///< a key of YAML without a value
  bool group = false;                ///< a key of YAML with an empty group of keys, {}

  /// Folder of the options file; empty for the command line.
  std::filesystem::path folder() const;
  /// "-name value", with " (file:line)" behind it unless it comes from the command line.
  std::string text() const;
};

/// Settings in the order of the arguments (without the program's name). The argument after a name is its value unless
/// it is a name itself: a dash and a letter, so that -1 and -inf are values. `--name` is read as `-name`. Errors:
/// InputError for an argument that belongs to no option; here and below also for a name or value that is too long or
/// not plain text.
std::vector<Setting> read_arguments(const std::vector<std::string>& arguments);

/// Settings of an options file: YAML if its name ends in .yaml or .yml (nested keys join with `_`, lists of plain
/// values with `,`), else the text format of PETSc (`-name value`, `#` starts a comment, quotes keep blanks). A bare
/// `-name` of the text format is a flag, as on the command line. Errors: InputError naming file and line if
/// it cannot be read, is larger than 64 KiB, is malformed, has more than 1000 keys (as aliases of aliases do) or 20
/// levels, gives an option twice, or names another options file.
std::vector<Setting> read_options_file(const std::string& file);

}  // namespace pliant
