#include "tests/statistical/reference_cases.h"

#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace woodcock::reference {

double Case::get(const std::string& name, double otherwise) const {
  const auto it = parameters.find(name);
  return it == parameters.end() ? otherwise : it->second;
}

double Case::get(const std::string& name) const { return parameters.at(name); }

std::vector<Case> read_cases(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  std::vector<Case> cases;
  for (const auto& entry : nlohmann::json::parse(file)) {
    Case c;
    c.id = entry.at("id");
    c.what = entry.at("what");
    c.source = entry.at("source");
    c.uncertainty = entry.at("uncertainty");
    for (const auto& [name, value] : entry.at("params").items())
      if (value.is_number()) c.parameters[name] = value;
    const auto& expected = entry.at("expected");
    if (expected.is_number()) {
      c.expected[""] = expected;
    } else {
      for (const auto& [name, value] : expected.items()) c.expected[name] = value;
    }
    cases.push_back(std::move(c));
  }
  return cases;
}

}  // namespace woodcock::reference
