#pragma once

#include <torch/csrc/jit/api/module.h>

#include <filesystem>
#include <string>

namespace doppel {

/// A TorchScript file is a program: its functions may write to the disk, and methods called `__setstate__` run while
/// the file is loaded. Two checks come before anything in a file from outside runs: that of the archive before
/// `torch::jit::load`, and that of the loaded functions before the first call.

/// Whether a file of ours may call an operator ("aten::add"): a fixed list of operators that only compute, and Doppel's
/// own. `doppel export` writes no other.
bool is_script_operator(const std::string& name);

/// @throws FileError when the file is no archive, when its compressed parts would take more than 256 MB of memory, or
/// when its code has methods that run while it is loaded, or classes of other libraries. The message begins with
/// `shown`.
void check_script_archive(const std::filesystem::path& path, const std::filesystem::path& shown);

/// @throws FileError when a function of the module or of its parts calls an operator that `is_script_operator` refuses,
/// or has hooks
void check_script_functions(const torch::jit::Module& module, const std::filesystem::path& shown);

}  // namespace doppel
