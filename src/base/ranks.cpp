#include <pliant/base/ranks.h>

#include <cstring>

namespace pliant {

void Ranks::together(const std::function<void()>& body) const {
  if (!several()) return body();
  std::optional<Error> error;
  try {
    body();
  } catch (...) {
    error = error_in_flight();
  }
  const int first = size_ - 1 - max(error ? size_ - 1 - rank_ : -1);
  if (first == size_) return;
  std::vector<char> text;
  if (rank_ == first) text.assign(error->what(), error->what() + std::strlen(error->what()));
  const auto code = broadcast(rank_ == first ? error->code() : ExitCode::done, first);
  broadcast(text, first);
  throw Error(code, std::string(text.begin(), text.end()));
}

void Ranks::on_root(const std::function<void()>& body) const {
  together([&] {
    if (root()) body();
  });
}

}  // namespace pliant
