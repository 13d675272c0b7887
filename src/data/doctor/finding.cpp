#include "doppel/data/doctor/finding.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace doppel {

std::string to_string(Severity severity) {
  switch (severity) {
    case Severity::note:
      return "note";
    case Severity::warning:
      return "warning";
    case Severity::fault:
      return "fault";
  }
  return "";
}

std::string to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::healthy:
      return "healthy";
    case Verdict::suspicious:
      return "suspicious";
    case Verdict::faulty:
      return "faulty";
  }
  return "";
}

Verdict verdict_of(const std::vector<Finding>& findings) {
  Severity worst = Severity::note;
  for (const Finding& finding : findings) worst = std::max(worst, finding.severity);
  if (worst == Severity::fault) return Verdict::faulty;
  return worst == Severity::warning ? Verdict::suspicious : Verdict::healthy;
}

std::vector<Finding> sorted_findings(std::vector<Finding> findings, const std::vector<std::string>& cameras) {
  const auto index_of = [&](const Finding& finding) {
    return std::find(cameras.begin(), cameras.end(), finding.camera) - cameras.begin();
  };
  std::stable_sort(findings.begin(), findings.end(), [&](const Finding& a, const Finding& b) {
    if (a.severity != b.severity) return a.severity > b.severity;
    if (a.camera.empty() != b.camera.empty()) return a.camera.empty();
    return index_of(a) < index_of(b);
  });
  std::vector<Finding> kept;
  for (Finding& finding : findings) {
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Finding& other) {
      return other.camera == finding.camera && other.fault == finding.fault;
    });
    if (!known) kept.push_back(std::move(finding));
  }
  return kept;
}

nlohmann::ordered_json findings_json(const std::vector<Finding>& findings) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Finding& finding : findings) {
    nlohmann::ordered_json camera = nullptr;
    if (!finding.camera.empty()) camera = finding.camera;
    list.push_back({{"camera", camera},
                    {"fault", finding.fault},
                    {"severity", to_string(finding.severity)},
                    {"figure", finding.figure},
                    {"advice", finding.advice}});
  }
  return {{"verdict", to_string(verdict_of(findings))}, {"findings", list}};
}

}  // namespace doppel
