// A light subpath kept with its bsdfs prepared, to be connected to many vertices. Room is kept between paths.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "worker/transport/vertex.h"

namespace candela::transport {

class Subpath {
 public:
  struct Slot {
    Vertex vertex;
    scene::ClosureArena arena;  // parts of its closure
  };

  void clear() { size_ = 0; }
  std::uint32_t size() const { return size_; }
  const Vertex& operator[](std::uint32_t i) const { return slots_[i]->vertex; }

  // The slot that the next vertex may be made in; it counts only once kept. References stay valid.
  Slot& next() {
    if (size_ == slots_.size()) slots_.push_back(std::make_unique<Slot>());
    return *slots_[size_];
  }
  std::uint32_t keep() { return size_++; }

 private:
  std::vector<std::unique_ptr<Slot>> slots_;
  std::uint32_t size_ = 0;
};

}  // namespace candela::transport
