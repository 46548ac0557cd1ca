// The choice of a contact law among those that a model has.
#pragma once

#include <array>
#include <stdexcept>
#include <string_view>

#include <pliant/kernels/contact_law.h>
#include <pliant/model/parameter.h>

namespace pliant {

constexpr std::string_view to_string(ContactLaw law) {
  switch (law) {
    case ContactLaw::harmonic:
      return "harmonic";
    case ContactLaw::hertz:
      return "hertz";
    case ContactLaw::barrier:
      return "barrier";
    case ContactLaw::spring:
      return "spring";
    case ContactLaw::linear:
      return "linear";
  }
  return "";
}

/// The law with this name.
constexpr ContactLaw contact_law(std::string_view name) {
  for (const ContactLaw law :
       {ContactLaw::harmonic, ContactLaw::hertz, ContactLaw::barrier, ContactLaw::spring, ContactLaw::linear})
    if (name == to_string(law)) return law;
  throw std::invalid_argument("no contact law has this name");
}

/// The choice among these laws, the first being the default.
template <class... Laws>
ContactLaw read_contact_law(ParameterReader& p, Laws... laws) {
  return p.choice({.name = "contact_law",
                   .help = "law of contact forces; linear: the same force scale for all sizes",
                   .role = Role::contact_law},
                  std::array{std::pair{to_string(laws), laws}...});
}

}  // namespace pliant
