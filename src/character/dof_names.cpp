#include "doppel/character/dof_names.h"

namespace doppel {
namespace {

bool fits(const std::string& pattern, const std::string& name) {
  std::size_t p = 0, n = 0, last_star = std::string::npos, taken = 0;
  while (n < name.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      last_star = p++;
      taken = n;
    } else if (p < pattern.size() && pattern[p] == name[n]) {
      ++p;
      ++n;
    } else if (last_star != std::string::npos) {
      p = last_star + 1;  // the star matches one more character
      n = ++taken;
    } else {
      return false;
    }
  }
  while (p < pattern.size() && pattern[p] == '*') ++p;
  return p == pattern.size();
}

}  // namespace

std::vector<int> find_dofs(const Skeleton& skeleton, const std::string& pattern) {
  std::vector<int> found;
  for (int d = 0; d < skeleton.num_dofs(); ++d)
    if (fits(pattern, skeleton.dofs[d].name)) found.push_back(d);
  return found;
}

}  // namespace doppel
