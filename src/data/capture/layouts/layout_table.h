#pragma once

#include <vector>

#include "doppel/data/capture/layouts/folder_layout.h"

namespace doppel {

/// All layouts, in the order in which a folder is asked for their signs: the surest first. The last one fits every
/// folder.
const std::vector<FolderLayout>& folder_layouts();

}  // namespace doppel
