#include <pliant/io/ensemble_file.h>

#include <fmt/format.h>

#include <pliant/base/errors.h>
#include <pliant/io/folder_lock.h>

namespace pliant {
namespace {

std::filesystem::path file_in(const std::filesystem::path& folder) { return folder / "ensemble.h5"; }
const char* const members_name = "/members";
const char* const ensemble_name = "/ensemble";

}  // namespace

EnsembleFile EnsembleFile::create(const std::filesystem::path& folder, const nlohmann::ordered_json& ensemble) {
  create_folder(folder);
  // The file gets its name only when it can be read, so that a kill leaves no unreadable file.
  const auto begun = folder / "ensemble.h5.new";
  std::error_code ignored;
  std::filesystem::remove(begun, ignored);
  hdf5::File file = hdf5::File::create(begun);
  file.create_group(members_name);
  file.write_text(ensemble_name, ensemble.dump());
  file.flush();
  file.rename(file_in(folder));
  return {std::move(file), ensemble};
}

std::optional<EnsembleFile> EnsembleFile::open(const std::filesystem::path& folder) {
  std::error_code ignored;
  if (!std::filesystem::exists(file_in(folder), ignored)) return {};
  hdf5::File file = hdf5::File::open_write(file_in(folder));
  auto ensemble = nlohmann::ordered_json::parse(file.read_text(ensemble_name), nullptr, false);
  if (!ensemble.is_object())
    throw InputError("{} is damaged: the description of the ensemble cannot be read; choose another folder",
                     file_in(folder).string());
  return EnsembleFile(std::move(file), std::move(ensemble));
}

void EnsembleFile::describe(const nlohmann::ordered_json& ensemble) {
  file_.remove(ensemble_name);
  file_.write_text(ensemble_name, ensemble.dump());
  ensemble_ = ensemble;
}

std::vector<StoredMember> EnsembleFile::members() const {
  std::vector<StoredMember> all;
  const auto group = file_.open_group(members_name);
  for (const std::string& name : group.links()) {
    const auto member = group.open_group(name);
    auto summary = nlohmann::ordered_json::parse(member.read_text("summary"), nullptr, false);
    const auto number = member.integer_attribute("number");
    if (!summary.is_object() || name != fmt::format("{:06}", number))
      throw InputError("{}: member {} is damaged; choose another folder", file_.name(), name);
    all.push_back({static_cast<Index>(number), std::move(summary)});
  }
  return all;
}

void EnsembleFile::add(Index number, const std::string& summary, std::string_view objects) {
  const std::string name = fmt::format("{:06}", number);
  auto members = file_.open_group(members_name);
  if (members.has(name)) members.remove(name);
  // Linked before it has content: HDF5 1.10 loses links of a group without a name if a large copy displaces the group
  // from the metadata cache. Nothing is in the file before flush().
  auto group = members.create_group(name);
  group.set_attribute("number", static_cast<std::int64_t>(number));
  group.write_text("summary", summary);
  if (!objects.empty()) group.add(objects);
  group.count_members();
  members.count_members();
}

}  // namespace pliant
