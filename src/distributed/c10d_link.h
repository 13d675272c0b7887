#pragma once

#include <torch/types.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

namespace doppel {

/// The engine behind `Ranks`: PyTorch's c10d with Gloo. Only c10d_link.cpp includes its headers.

/// Short notes that all ranks read and write, kept by one process at host:port. Every call may block while that process
/// does not answer. @throws std::exception when the connection breaks
class NoteBoard {
 public:
  /// @param keeper this process opens the port @param attempt begins the names of all notes
  /// @throws Error when the port is in use, or nobody answers within `limit`
  NoteBoard(const std::string& host, int port, bool keeper, const std::string& attempt,
            std::chrono::milliseconds limit);
  ~NoteBoard();
  NoteBoard(const NoteBoard&) = delete;
  NoteBoard& operator=(const NoteBoard&) = delete;

  void write(const std::string& name, const std::string& text);
  bool has(const std::string& name);
  /// @pre has(name)
  std::string read(const std::string& name);
  /// Adds to a counter, which begins at 0. @return the new value
  std::int64_t add(const std::string& name, std::int64_t amount);

 private:
  friend class Exchanges;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// An exchange that is under way.
class Exchange {
 public:
  struct Impl;
  explicit Exchange(std::unique_ptr<Impl> impl);
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;
  Exchange(Exchange&&) noexcept;
  ~Exchange();

  /// Waits for the end, at most for `limit`. @return whether the end is reached
  /// @throws std::exception when a connection broke
  bool wait(std::chrono::milliseconds limit);

 private:
  std::unique_ptr<Impl> impl_;
};

/// The connections between all ranks. All ranks must start the same exchanges in the same order.
class Exchanges {
 public:
  /// Connects with all other ranks. @param name of this set of connections @param limit of one exchange
  Exchanges(NoteBoard& board, const std::string& name, int rank, int world, std::chrono::milliseconds limit);
  ~Exchanges();
  Exchanges(const Exchanges&) = delete;
  Exchanges& operator=(const Exchanges&) = delete;

  /// Replaces a contiguous tensor by the sum over the ranks, which has the same bits on all ranks.
  Exchange sum(torch::Tensor tensor);
  /// The contiguous tensors of all ranks. @param parts one for each rank, of the same size, to be filled
  Exchange gather(torch::Tensor tensor, std::vector<torch::Tensor> parts);
  /// Replaces a contiguous tensor by that of rank 0.
  Exchange broadcast(torch::Tensor tensor);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace doppel
