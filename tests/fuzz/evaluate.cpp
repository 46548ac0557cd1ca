// Case files of `pliant evaluate`: an answer in finite numbers or a refusal.
#include "fuzz.h"

#include <cmath>

#include <pliant/scenarios/evaluate/evaluate.h>

namespace {

void check_finite(const nlohmann::ordered_json& value) {
  if (value.is_number_float() && !std::isfinite(value.get<double>())) std::abort();
  if (value.is_structured())
    for (const auto& item : value) check_finite(item);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  expect_answer_or_refusal([&] {
    const std::string file = as_file("case.json", data, size);
    const auto result = pliant::evaluate(pliant::read_case(file), file);
    check_finite(result);
    if (pliant::to_text(result).empty()) std::abort();
  });
  return 0;
}
