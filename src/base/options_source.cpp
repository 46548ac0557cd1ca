#include <pliant/base/errors.h>
#include <pliant/base/options_source.h>
#include <pliant/base/text.h>
#include <yaml.h>

#include <algorithm>
#include <cctype>
#include <iterator>
#include <map>

namespace pliant {
namespace {

struct Token {
  std::string text;
  int line;
  bool quoted;
};

std::string place(const std::string& source, int line) {
  return line > 0 ? fmt::format("{}:{}", source, line) : source;
}

bool is_name(const Token& token) {
  const std::string& t = token.text;
  const std::size_t dashes = t.starts_with("--") ? 2 : 1;
  if (token.quoted || !t.starts_with('-') || t.size() <= dashes) return false;
  if (std::isalpha(static_cast<unsigned char>(t[dashes])) == 0) return false;
  std::string word = t.substr(dashes);
  std::transform(word.begin(), word.end(), word.begin(), [](unsigned char c) { return std::tolower(c); });
  return word != "inf" && word != "infinity" && word != "nan";
}

std::vector<Setting> settings_from(const std::vector<Token>& tokens, const std::string& source) {
  std::vector<Setting> settings;
  for (std::size_t i = 0; i < tokens.size(); ++i) {
    if (!is_name(tokens[i]))
      throw InputError("unexpected argument '{}' ({}); options are written -name value", printable(tokens[i].text),
                       place(source, tokens[i].line));
    Setting setting{tokens[i].text.substr(tokens[i].text.starts_with("--") ? 2 : 1), {}, source, tokens[i].line};
    if (i + 1 < tokens.size() && !is_name(tokens[i + 1])) setting.value = tokens[++i].text;
    settings.push_back(std::move(setting));
  }
  return settings;
}

std::string read_whole(const std::string& file) {
  constexpr std::size_t largest = 1 << 16;  // a line for every option there is takes a tenth of it
  std::string text = read_text_file(file, largest, "options file");
  if (text.find('\0') != std::string::npos)
    throw InputError("options file {}: is not a text file (it contains zero bytes)", file);
  return text;
}

// Refuses text that no option can have, before a message or a file repeats it.
std::vector<Setting> checked(std::vector<Setting> settings) {
  constexpr std::size_t longest_name = 100, longest_value = 4096;
  for (const Setting& setting : settings) {
    if (setting.name.size() > longest_name || !is_plain_text(setting.name))
      throw InputError("unknown option {}; -help lists all options", setting.text());
    if (!setting.value) continue;
    if (!is_plain_text(*setting.value))
      throw InputError("{}: is not plain text; it must be UTF-8 without control characters", setting.text());
    if (setting.value->size() > longest_value)
      throw InputError("{}: is too long; the limit is {} bytes", setting.text(), longest_value);
  }
  return settings;
}

std::vector<Token> tokens_of(const std::string& text, const std::string& file) {
  std::vector<Token> tokens;
  int line = 1;
  for (std::size_t i = 0; i < text.size();) {
    const char c = text[i];
    if (c == '#') {
      i = std::min(text.find('\n', i), text.size());
    } else if (std::isspace(static_cast<unsigned char>(c)) != 0) {
      line += c == '\n';
      ++i;
    } else if (c == '"' || c == '\'') {
      const std::size_t end = text.find_first_of(std::string{c, '\n'}, i + 1);
      if (end == std::string::npos || text[end] != c)
        throw InputError("options file {}:{}: a quote is not closed in its line", file, line);
      tokens.push_back({text.substr(i + 1, end - i - 1), line, true});
      i = end + 1;
    } else {
      const std::size_t end = std::min(text.find_first_of(" \t\r\n\v\f#", i), text.size());
      tokens.push_back({text.substr(i, end - i), line, false});
      i = end;
    }
  }
  return tokens;
}

// PETSc's YAML reader gives no line numbers, lets the last of two equal keys win, stops silently at a zero byte and
// keeps a half-built prefix after an error. Therefore this file calls libyaml, which PETSc's reader uses too.
class YamlReader {
 public:
  YamlReader(const std::string& text, const std::string& file) : text_(text), file_(file) {
    if (yaml_parser_initialize(&parser_) == 0) throw InputError("options file {}: no memory to read it", file);
    yaml_parser_set_input_string(&parser_, reinterpret_cast<const unsigned char*>(text.data()), text.size());
  }
  ~YamlReader() { yaml_parser_delete(&parser_); }
  YamlReader(const YamlReader&) = delete;
  YamlReader& operator=(const YamlReader&) = delete;

  std::vector<Setting> read() {
    while (read_document()) {
    }
    return std::move(settings_);
  }

 private:
  struct Document {
    yaml_document_t yaml{};
    Document() = default;
    ~Document() { yaml_document_delete(&yaml); }
    Document(const Document&) = delete;
    Document& operator=(const Document&) = delete;
  };

  bool read_document() {
    Document document;
    if (yaml_parser_load(&parser_, &document.yaml) == 0) malformed();
    yaml_node_t* root = yaml_document_get_root_node(&document.yaml);
    if (root == nullptr) return false;
    const bool empty = root->type == YAML_SCALAR_NODE && root->data.scalar.length == 0;
    if (!empty) read_mapping(document.yaml, *root, "", 0);
    return true;
  }

  void read_mapping(yaml_document_t& document, const yaml_node_t& node, const std::string& prefix, int depth) {
    if (node.type != YAML_MAPPING_NODE) fail(node, "expected lines of the form `name: value`");
    constexpr int deepest = 20;  // an alias may contain itself
    if (depth > deepest) fail(node, fmt::format("keys are nested deeper than {} levels", deepest));
    for (auto* pair = node.data.mapping.pairs.start; pair < node.data.mapping.pairs.top; ++pair) {
      const yaml_node_t& key = *yaml_document_get_node(&document, pair->key);
      const yaml_node_t& value = *yaml_document_get_node(&document, pair->value);
      constexpr int most = 1000;  // aliases of aliases may expand to more than can be read
      if (++keys_ > most) fail(key, fmt::format("the file has more than {} keys, with aliases expanded", most));
      if (key.type != YAML_SCALAR_NODE) fail(key, "a key must be a plain name");
      const std::string word = scalar(key);
      if (word.empty()) fail(key, "a key is empty");
      if (word == "<<" || word.starts_with("$$"))
        fail(key, fmt::format("the key {} is not supported", printable(word)));
      const std::string name = prefix + word;
      const bool empty =
          value.type == YAML_MAPPING_NODE && value.data.mapping.pairs.start == value.data.mapping.pairs.top;
      if (value.type == YAML_MAPPING_NODE && !empty) {
        read_mapping(document, value, name + "_", depth + 1);
      } else {
        Setting& setting = settings_.emplace_back(Setting{name, {}, file_, line(key)});
        setting.group = empty;
        setting.null = empty || is_null(value);
        if (!setting.null) setting.value = value_of(document, value);
      }
    }
  }

  /// Whether it is null in one of YAML's spellings.
  bool is_null(const yaml_node_t& node) {
    if (node.type != YAML_SCALAR_NODE) return false;
    if (node.tag != nullptr && std::string_view(reinterpret_cast<const char*>(node.tag)) == YAML_NULL_TAG) return true;
    if (node.data.scalar.style != YAML_PLAIN_SCALAR_STYLE) return false;
    const std::string text = scalar(node);
    return text.empty() || text == "~" || text == "null" || text == "Null" || text == "NULL";
  }

  std::string value_of(yaml_document_t& document, const yaml_node_t& node) {
    if (node.type == YAML_SCALAR_NODE) return scalar(node);
    std::string joined;
    for (auto* item = node.data.sequence.items.start; item < node.data.sequence.items.top; ++item) {
      const yaml_node_t& element = *yaml_document_get_node(&document, *item);
      if (element.type != YAML_SCALAR_NODE) fail(element, "a list may hold plain values only");
      if (is_null(element)) fail(element, "an item of a list has no value; give it one, or leave it out");
      if (item != node.data.sequence.items.start) joined += ',';
      joined += scalar(element);
    }
    return joined;
  }

  std::string scalar(const yaml_node_t& node) {
    std::string text(reinterpret_cast<const char*>(node.data.scalar.value), node.data.scalar.length);
    if (text.find('\0') != std::string::npos) fail(node, "a value contains a zero byte");
    return text;
  }

  static int line(const yaml_node_t& node) { return static_cast<int>(node.start_mark.line) + 1; }

  [[noreturn]] void fail(const yaml_node_t& node, const std::string& what) const {
    throw InputError("options file {}:{}: {}", file_, line(node), what);
  }

  [[noreturn]] void malformed() const {
    const bool tab = text_.find('\t') != std::string::npos;
    // An encoding error has an offset, not a line.
    const int at =
        parser_.error == YAML_READER_ERROR
            ? 1 + static_cast<int>(std::count(
                      text_.begin(),
                      text_.begin() + static_cast<std::ptrdiff_t>(std::min(parser_.problem_offset, text_.size())),
                      '\n'))
            : static_cast<int>(parser_.problem_mark.line) + 1;
    throw InputError("options file {}:{}: malformed YAML: {}{}", file_, at,
                     parser_.problem != nullptr ? parser_.problem : "no reason given",
                     tab ? " (the file has tabs; indent with spaces)" : "");
  }

  const std::string& text_;
  const std::string& file_;
  yaml_parser_t parser_{};
  std::vector<Setting> settings_;
  int keys_ = 0;
};

}  // namespace

std::string Setting::text() const {
  std::string result = fmt::format("-{}", printable(name));
  if (value) result.append(1, ' ').append(printable(*value));
  if (line > 0) result += fmt::format(" ({})", place(source, line));
  return result;
}

std::filesystem::path Setting::folder() const {
  return line > 0 ? std::filesystem::path(source).parent_path() : std::filesystem::path();
}

std::vector<Setting> read_arguments(const std::vector<std::string>& arguments) {
  std::vector<Token> tokens;
  for (const auto& argument : arguments) tokens.push_back({argument, 0, false});
  return checked(settings_from(tokens, "command line"));
}

std::vector<Setting> read_options_file(const std::string& file) {
  const std::string text = read_whole(file);
  const bool yaml = file.ends_with(".yaml") || file.ends_with(".yml");
  std::vector<Setting> settings =
      checked(yaml ? YamlReader(text, file).read() : settings_from(tokens_of(text, file), file));
  std::map<std::string, int> lines;
  for (const auto& setting : settings) {
    if (setting.name == "options_file")
      throw InputError("options file {}: names another options file; give both on the command line instead",
                       place(file, setting.line));
    const auto [first, is_new] = lines.emplace(setting.name, setting.line);
    if (!is_new)
      throw InputError("options file {}: {} is given twice, first in line {}", place(file, setting.line), setting.name,
                       first->second);
  }
  return settings;
}

}  // namespace pliant
