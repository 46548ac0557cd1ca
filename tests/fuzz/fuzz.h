// Shared by the harnesses: one PETSc session, and the input as a file, as from users.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

#include <pliant/base/petsc.h>

/// Calls body(); input errors are expected, every other exception is a finding.
template <class Body>
void expect_answer_or_refusal(Body&& body) {
  static pliant::PetscSession& session = *new pliant::PetscSession;  // for the life of the process
  (void)session;
  try {
    body();
  } catch (const pliant::InputError&) {
  } catch (const pliant::Error& error) {
    if (error.code() == pliant::ExitCode::numerical_failure &&
        std::string(error.what()).find("PETSc") == std::string::npos)
      return;  // beyond the range of numbers
    throw;
  }
}

/// Writes the input to a file of this name in a folder of this process.
inline std::string as_file(const char* name, const std::uint8_t* data, std::size_t size) {
  static const std::string folder = [] {
    std::string path = (std::filesystem::temp_directory_path() / "pliant-fuzz-XXXXXX").string();
    if (mkdtemp(path.data()) == nullptr) std::abort();
    return path;
  }();
  const std::string path = folder + "/" + name;
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr || std::fwrite(data, 1, size, file) != size || std::fclose(file) != 0) std::abort();
  return path;
}
