// Packings at given pressures or fractions, along a path from a random start.
#pragma once

#include <string>
#include <vector>

#include <pliant/scenarios/packings/protocol.h>

namespace pliant {

template <int D>
class PackProtocol : public PackingProtocol<D> {
 public:
  /// p must outlive it. quick: see PackingProtocol.
  PackProtocol(const PackOptions& p, const Ranks& ranks, bool quick);

  std::string title() const override;
  Real last_time() const override;
  std::string end_at_last_time() const override;
  bool follow() override {
    if (at_pressure_) this->run().end("done", "pressure");
    return false;
  }
  void judge_end() override { follow(); }

 protected:
  void make_next() override;
  bool quick() const override { return quick_; }
  void visit_more(Archive& archive) override;
  /// Packings of a decompression, or the quench.
  Real steps() const;

 private:
  const PackOptions& p_;
  std::vector<Real> pressures_;
  bool quick_;
  bool at_pressure_ = false;  ///< a compression has ended
};

extern template class PackProtocol<2>;
extern template class PackProtocol<3>;

}  // namespace pliant
