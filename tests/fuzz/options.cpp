// Options files, YAML and text: read or refused, never a crash; read options survive a checkpoint.
#include "fuzz.h"

#include <pliant/scenarios/hopper/options.h>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  for (const char* name : {"options.yaml", "options.txt"}) {
    expect_answer_or_refusal([&] {
      const std::string file = as_file(name, data, size);
      pliant::HopperOptions parameters, again;
      pliant::Options options, stored;
      parameters.bind(options);
      options.parse({"-options_file", file});
      const std::string text = options.json().dump();
      again.bind(stored);
      stored.parse({});
      try {
        stored.from_json(nlohmann::json::parse(text));
      } catch (const pliant::InputError&) {
        std::abort();  // was accepted before
      }
      if (stored.json().size() != options.json().size()) std::abort();
    });
  }
  return 0;
}
