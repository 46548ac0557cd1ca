// Models that a program adds to those of the catalogue.
#pragma once

#include <concepts>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/catalogue/catalogue.h>

namespace pliant {

/// Makes the forces of a model, once the options of its own have their values.
class ForceFieldMaker {
 public:
  virtual ~ForceFieldMaker() = default;
  /// p: what the options of the scenario say. Errors: InputError for a number of dimensions that the model lacks.
  virtual std::unique_ptr<ForceField<2>> make(const ModelParameters& p, const Vec<2>& gravity) const = 0;
  virtual std::unique_ptr<ForceField<3>> make(const ModelParameters& p, const Vec<3>& gravity) const = 0;
};

/// What a scenario knows of such a model.
struct OwnModel {
  std::string name, help;
  ModelKind particles;             ///< shapes and sizes of the particles are those of sp, rough or smooth
  std::vector<std::string> reads;  ///< options of the scenario that the model reads, of those that not all models do
  std::vector<std::string> options = {};  ///< names of its own
  /// Binds its own options; the maker that is returned has their values.
  std::function<std::shared_ptr<const ForceFieldMaker>(Options&)> bind = {};
};

/// The maker of a model M; see own_model.
template <class M>
class OwnMaker final : public ForceFieldMaker {
 public:
  OwnMaker(std::string name, Options& options) : name_(std::move(name)) { model_.bind(options); }
  std::unique_ptr<ForceField<2>> make(const ModelParameters& p, const Vec<2>& gravity) const override {
    return make_in<2>(p, gravity);
  }
  std::unique_ptr<ForceField<3>> make(const ModelParameters& p, const Vec<3>& gravity) const override {
    return make_in<3>(p, gravity);
  }

 private:
  template <int D>
  std::unique_ptr<ForceField<D>> make_in(const ModelParameters& p, const Vec<D>& gravity) const {
    if constexpr (requires {
                    { model_.force_field(p, gravity) } -> std::same_as<std::unique_ptr<ForceField<D>>>;
                  })
      return model_.force_field(p, gravity);
    else
      throw InputError("-model {} does not exist in {}D; use -dim {}", name_, D, 5 - D);
  }

  std::string name_;
  M model_;
};

/// An M has bind(Options&) for options of its own, and for D = 2, for 3 or for both
/// std::unique_ptr<ForceField<D>> force_field(const ModelParameters&, const Vec<D>& gravity) const.
template <class M>
OwnModel own_model(const std::string& name, std::string help, ModelKind particles, std::vector<std::string> reads) {
  OwnModel own{.name = name, .help = std::move(help), .particles = particles, .reads = std::move(reads)};
  own.bind = [name](Options& options) { return std::make_shared<const OwnMaker<M>>(name, options); };
  Options alone;
  own.bind(alone);
  const nlohmann::json bound = alone.json();
  for (const auto& option : bound.items()) own.options.push_back(option.key());
  return own;
}

}  // namespace pliant
