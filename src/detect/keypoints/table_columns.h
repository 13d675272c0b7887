#pragma once

#include <array>
#include <string>
#include <vector>

namespace doppel {

/// What a column of a table of points holds. The numbers are positions in TableColumns.
enum TableRole {
  kFrameColumn,
  kImageColumn,
  kCameraColumn,
  kPersonColumn,
  kNameColumn,
  kNumberColumn,
  kXColumn,
  kYColumn,
  kZColumn,
  kConfidenceColumn,
  kTableRoles
};

/// [kTableRoles] positions of the columns; -1: there is none.
using TableColumns = std::array<int, kTableRoles>;

/// The roles of columns by their usual names, in any spelling (plain_column). A column has one role.
TableColumns columns_of_table(const std::vector<std::string>& header);

}  // namespace doppel
