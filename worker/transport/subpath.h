// Rooms: the loops of eye_path.h and light_path.h put their vertices there, one after another in a
// subpath that is kept, or two in turn.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "worker/transport/vertex.h"

namespace candela::transport {

// A place for a vertex, with the parts of its closure.
template <class Block>
struct VertexSlot {
  Vertex<Block> vertex;
  scene::ClosureArena arena;
};

// The vertex at hand and the one it was reached from.
template <class Block>
class VertexPair {
 public:
  void clear() { before_ = nullptr; }
  VertexSlot<Block>& next() { return slots_[at_]; }
  // Null: the end point.
  const Vertex<Block>* before() const { return before_; }
  // The walk scattered at the last vertex, passed it straight, or ends there.
  void keep() {
    before_ = &slots_[at_].vertex;
    at_ ^= 1;
  }
  void pass() {}
  void end() {}

 private:
  VertexSlot<Block> slots_[2];
  const Vertex<Block>* before_ = nullptr;
  int at_ = 0;
};

// Vertices of one subpath with evaluated BSDFs, ready for connections. Reuses its memory across paths.
template <class Block>
class Subpath {
 public:
  void clear() {
    size_ = 0;
    last_ = scene::kNone;
  }
  std::uint32_t size() const { return size_; }
  const Vertex<Block>& operator[](std::uint32_t i) const { return slots_[i]->vertex; }

  // The slot that the next vertex may be made in; it counts only if added. References stay valid.
  VertexSlot<Block>& next() {
    if (size_ == slots_.size()) slots_.push_back(std::make_unique<VertexSlot<Block>>());
    VertexSlot<Block>& slot = *slots_[size_];
    slot.vertex.parent = last_;
    return slot;
  }
  std::uint32_t add() { return size_++; }

  // The vertex that the one at hand was reached from; null: the end point.
  const Vertex<Block>* before() const { return last_ == scene::kNone ? nullptr : &slots_[last_]->vertex; }
  // As VertexPair. A surface passed straight stays in the list, where its other lobes may be connected; so
  // does a last vertex that can be connected.
  void keep() { last_ = add(); }
  void pass() { add(); }
  void end() {
    if (slots_[size_]->vertex.connectible) add();
  }

 private:
  std::vector<std::unique_ptr<VertexSlot<Block>>> slots_;
  std::uint32_t size_ = 0, last_ = scene::kNone;
};

}  // namespace candela::transport
