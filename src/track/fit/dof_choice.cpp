#include "doppel/track/fit/dof_choice.h"

#include <set>

#include "doppel/character/dof_names.h"
#include "doppel/character/observable_dofs.h"
#include "doppel/core/config.h"
#include "doppel/core/error.h"

namespace doppel {
std::vector<int> named_dofs(const Skeleton& skeleton, const char* key, const std::vector<std::string>& patterns) {
  std::set<int> dofs;
  for (const std::string& pattern : patterns) {
    const std::vector<int> found = find_dofs(skeleton, pattern);
    if (found.empty()) {
      std::vector<std::string> known;
      for (const Dof& dof : skeleton.dofs) known.push_back(dof.name);
      fail<UsageError>("`{}` names '{}', but the skeleton has no such DoF; the nearest is '{}'", key, pattern,
                       nearest_word(pattern, known).value_or(known.empty() ? "" : known.front()));
    }
    dofs.insert(found.begin(), found.end());
  }
  return {dofs.begin(), dofs.end()};
}

void describe_keys(const Keys& keys, DofChoice& choice) {
  keys("dofs", choice.dofs, "names of the unknowns, `*` for any letters; empty: the DoFs that landmarks determine");
  keys("also", choice.also, "further unknowns");
  keys("hold", choice.hold, "DoFs that keep the values of the rest pose");
}

std::vector<int> chosen_dofs(const DofChoice& choice, const Skeleton& skeleton, const std::vector<Marker>& landmarks) {
  std::vector<int> first = named_dofs(skeleton, "dofs", choice.dofs);
  if (first.empty()) first = observable_dofs(skeleton, landmarks);
  std::set<int> dofs(first.begin(), first.end());
  for (const int dof : named_dofs(skeleton, "also", choice.also)) dofs.insert(dof);
  for (const int dof : named_dofs(skeleton, "hold", choice.hold)) dofs.erase(dof);
  return {dofs.begin(), dofs.end()};
}

}  // namespace doppel
