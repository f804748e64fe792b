#include "common/description/reading_budget.h"

#include <fmt/format.h>

#include "common/base/memory_limit.h"

namespace candela::description {
namespace {

constexpr std::uint64_t kBlock = 16;  // what the allocator adds to a block

std::string size_text(std::uint64_t bytes) {
  constexpr std::uint64_t mebibyte = std::uint64_t{1} << 20;
  if (bytes < mebibyte) return fmt::format("{} bytes", bytes);
  return fmt::format("{} MiB", (bytes + mebibyte / 2) / mebibyte);
}

}  // namespace

std::uint64_t ReadingBudget::default_bytes() {
  return memory_limit_bytes() / 2;
}

ReadingBudget& ReadingBudget::unlimited() {
  static ReadingBudget budget(kUnlimited);
  return budget;
}

Error ReadingBudget::refusal(const Location& where, std::string_view what, std::uint64_t bytes) const {
  refused_ = true;
  if (whole_ != nullptr) return whole_->refusal(where, what, bytes);
  return input_error(fmt::format("the scene needs more memory than the {} that reading it may take: {} are "
                                 "taken, and {} take {}",
                                 size_text(limit_), size_text(used()), what,
                                 bytes > 0 ? size_text(bytes) + " more" : "more"))
      .at(where.file, where.line)
      .with_mend("make the scene smaller, or give a larger --scene-memory if the machine has it");
}

ReadingBudget& FileSource::budget() const {
  return ReadingBudget::unlimited();
}

std::uint64_t memory_of(const Property& property) {
  const auto* text = std::get_if<std::string>(&property.value);
  return sizeof property + heap_bytes(property.name) + heap_bytes(property.where) +
         (text != nullptr ? heap_bytes(*text) : 0);
}

std::uint64_t memory_of(const Object& object) {
  std::uint64_t bytes = sizeof object + 2 * kBlock + heap_bytes(object.category) + heap_bytes(object.plugin) +
                        heap_bytes(object.id) + heap_bytes(object.where);
  bytes += (object.properties.capacity() - object.properties.size()) * sizeof(Property);
  for (const Property& property : object.properties) bytes += memory_of(property);
  bytes += object.children.capacity() * sizeof(Child);
  for (const Child& child : object.children) bytes += heap_bytes(child.slot);
  return bytes + (object.properties.empty() ? 0 : kBlock) + (object.children.empty() ? 0 : kBlock);
}

}  // namespace candela::description
