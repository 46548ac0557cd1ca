// Meshes as texts in OFF format.
#pragma once

#include <string>

#include <pliant/geometry/mesh.h>

namespace pliant {

/// The mesh as the text of an OFF file, with all digits.
std::string off_text(const TriangleMesh& mesh);

/// The mesh of such a text. name: of its source, for messages. Errors: as of read_mesh.
TriangleMesh mesh_of_off(const std::string& text, const std::string& name);

}  // namespace pliant
