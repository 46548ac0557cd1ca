#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <sstream>
#include <string_view>

#include <pliant/base/errors.h>
#include <pliant/base/text.h>
#include <pliant/geometry/off_text.h>

namespace pliant {
namespace {

constexpr std::size_t largest_mesh_file = 64 << 20;

/// The words of a text file, line by line, without comments.
class MeshLines {
 public:
  MeshLines(const std::string& text, std::string file) : text_(text), file_(std::move(file)) {}

  /// The next line that has words; false at the end.
  bool next() {
    std::string line;
    while (std::getline(text_, line)) {
      ++number_;
      if (const auto comment = line.find('#'); comment != line.npos) line.resize(comment);
      std::istringstream stream(line);
      words_.clear();
      for (std::string word; stream >> word;) words_.push_back(word);
      if (!words_.empty()) return true;
    }
    return false;
  }

  const std::vector<std::string>& words() const { return words_; }
  /// Drops the first word.
  void drop() { words_.erase(words_.begin()); }

  template <class... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> text, Args&&... args) const {
    throw InputError("{}: line {}: {}", file_, number_, fmt::format(text, std::forward<Args>(args)...));
  }

  Real number(std::size_t k) const {
    const std::string& word = words_[k];
    Real value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value))
      fail("\"{}\" is not a finite number", printable(word));
    return value;
  }

  /// A whole number from `least` to `most` at the begin of a word; a slash ends it.
  Index whole(std::string_view word, Index least, Index most) const {
    const std::string_view digits = word.substr(0, word.find('/'));
    Index value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || end != digits.data() + digits.size())
      fail("\"{}\" is not a whole number", printable(std::string(word)));
    if (value < least || value > most) fail("{} is not between {} and {}", value, least, most);
    return value;
  }

  Vec<3> place(std::size_t first) const {
    if (words_.size() < first + 3) fail("a vertex needs 3 coordinates, but {} are given", words_.size() - first);
    return {number(first), number(first + 1), number(first + 2)};
  }

 private:
  std::istringstream text_;
  std::string file_;
  int number_ = 0;
  std::vector<std::string> words_;
};

TriangleMesh read_off(MeshLines& lines) {
  const auto advance = [&](std::string_view wanted) {
    if (!lines.next()) lines.fail("the file ends here; {} are missing", wanted);
  };
  advance("the word OFF and the numbers of vertices and faces");
  if (lines.words()[0] != "OFF") lines.fail("the first word is \"{}\", but must be OFF", printable(lines.words()[0]));
  lines.drop();
  if (lines.words().empty()) advance("the numbers of vertices and faces");
  if (lines.words().size() < 2) lines.fail("the number of faces is missing");
  constexpr Index most = 1 << 24;
  const Index vertices = lines.whole(lines.words()[0], 4, most), faces = lines.whole(lines.words()[1], 4, most);
  TriangleMesh mesh;
  for (Index v = 0; v < vertices; ++v) {
    advance(fmt::format("{} of {} vertices", vertices - v, vertices));
    mesh.vertices.push_back(lines.place(0));
  }
  for (Index f = 0; f < faces; ++f) {
    advance(fmt::format("{} of {} faces", faces - f, faces));
    const auto& words = lines.words();
    if (words[0] != "3") lines.fail("a face of {} vertices, but faces must be triangles", printable(words[0]));
    if (words.size() < 4) lines.fail("a face needs 3 vertices, but {} are given", words.size() - 1);
    mesh.faces.push_back({lines.whole(words[1], 0, vertices - 1), lines.whole(words[2], 0, vertices - 1),
                          lines.whole(words[3], 0, vertices - 1)});
  }
  if (lines.next()) lines.fail("there is text after the last of {} faces; remove it or correct the number", faces);
  return mesh;
}

TriangleMesh read_obj(MeshLines& lines) {
  TriangleMesh mesh;
  while (lines.next()) {
    const auto& words = lines.words();
    if (words[0] == "v") mesh.vertices.push_back(lines.place(1));
    if (words[0] != "f") continue;
    if (words.size() != 4) lines.fail("a face of {} vertices, but faces must be triangles", words.size() - 1);
    const auto count = static_cast<Index>(mesh.vertices.size());
    if (count == 0) lines.fail("a face before all vertices; list the vertices first");
    // From 1, or backwards from the last vertex, which is −1.
    const auto vertex = [&](std::string_view word) {
      return word.starts_with('-') ? count + lines.whole(word, -count, -1) : lines.whole(word, 1, count) - 1;
    };
    mesh.faces.push_back({vertex(words[1]), vertex(words[2]), vertex(words[3])});
  }
  if (mesh.faces.empty()) lines.fail("the file has no faces (lines that begin with f)");
  return mesh;
}

TriangleMesh checked(TriangleMesh mesh, const std::string& name) {
  try {
    check_mesh(mesh);
  } catch (const InputError& error) {
    throw InputError("{}: {}", name, error.what());
  }
  return mesh;
}

}  // namespace

TriangleMesh read_mesh(const std::string& file) {
  const auto ends = [&](std::string_view end) {
    return file.size() > end.size() &&
           std::equal(end.rbegin(), end.rend(), file.rbegin(), [](char a, char b) { return (b | 0x20) == a; });
  };
  const bool off = ends(".off");
  if (!off && !ends(".obj")) throw InputError("mesh file {}: the name must end with .off or .obj", printable(file));
  const std::string text = read_text_file(file, largest_mesh_file, "mesh file");
  if (off) return mesh_of_off(text, printable(file));
  MeshLines lines(text, printable(file));
  return checked(read_obj(lines), printable(file));
}

TriangleMesh mesh_of_off(const std::string& text, const std::string& name) {
  MeshLines lines(text, name);
  return checked(read_off(lines), name);
}

std::string off_text(const TriangleMesh& mesh) {
  std::string text = fmt::format("OFF {} {} 0\n", mesh.vertices.size(), mesh.faces.size());
  for (const Vec<3>& r : mesh.vertices) text += fmt::format("{} {} {}\n", r[0], r[1], r[2]);
  for (const auto& [a, b, c] : mesh.faces) text += fmt::format("3 {} {} {}\n", a, b, c);
  return text;
}

}  // namespace pliant
