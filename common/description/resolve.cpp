#include "common/description/resolve.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/description/check.h"
#include "common/description/text.h"

namespace candela::description {
namespace {

constexpr int max_height = 128;
constexpr std::uint64_t max_unfolded = 20'000'000;
constexpr std::size_t max_resolved_notes = 100'000;

class Resolver {
 public:
  Resolver(std::vector<Draft>& drafts, const std::map<std::string, std::size_t, std::less<>>& ids,
           std::vector<Note>* passed_over)
      : drafts_(drafts), ids_(ids), passed_over_(passed_over), nodes_(drafts.size()) {}

  // `depth` bounds this recursion; `from` is where the draft is used.
  Result<void> visit(std::size_t index, int depth, const Location& from) {
    Node& node = nodes_[index];
    if (node.state == State::done) return {};
    Draft& draft = drafts_[index];
    if (node.state == State::open)
      return error_at(from, fmt::format("{} contains itself by this reference", describe(*draft.object)));
    if (depth > max_height)
      return error_at(from, fmt::format("objects are nested deeper than {} levels", max_height));
    node.state = State::open;
    std::vector<Location> where;
    // What Mitsuba has and Candela lacks (another integrator) is kept, but nobody knows its rules.
    const PluginRule* rule = find_plugin(draft.object->category, draft.object->plugin);
    for (const Link& link : draft.links) {
      std::size_t target = link.target;
      if (link.is_reference) {
        const auto found = ids_.find(link.id);
        if (found == ids_.end()) return unknown_id(link);
        target = found->second;
      }
      CANDELA_TRY(visit(target, depth + 1, link.where));
      node.height = std::max(node.height, nodes_[target].height + 1);
      node.unfolded = std::min(max_unfolded + 1, node.unfolded + nodes_[target].unfolded);
      const Child child{link.slot, drafts_[target].object};
      if (passed_over_ != nullptr && rule != nullptr &&
          is_for_unknown_parameter(*draft.object, *rule, child)) {
        if (passed_over_->size() < max_resolved_notes)
          passed_over_->push_back(
              passed_over_note(unknown_parameter(*draft.object, *rule, link.where, link.slot)));
        continue;
      }
      draft.object->children.push_back(child);
      where.push_back(link.where);
    }
    if (node.height > max_height)
      return error_at(from, fmt::format("objects are nested deeper than {} levels", max_height));
    if (node.unfolded > max_unfolded)
      return error_at(draft.object->where, fmt::format("{} unfolds into more than {} objects",
                                                       describe(*draft.object), max_unfolded));
    if (rule != nullptr) CANDELA_TRY(check_children(*draft.object, *rule, where));
    node.state = State::done;
    return {};
  }

 private:
  enum class State { untouched, open, done };
  struct Node {
    State state = State::untouched;
    int height = 1;
    std::uint64_t unfolded = 1;
  };

  Error unknown_id(const Link& link) const {
    std::vector<std::string_view> known;
    for (const auto& [id, target] : ids_) known.push_back(id);
    return error_at(link.where, fmt::format("no object has the id {}", text::quote(link.id)))
        .with_mend(text::did_you_mean(nearest_name(link.id, known)));
  }

  std::vector<Draft>& drafts_;
  const std::map<std::string, std::size_t, std::less<>>& ids_;
  std::vector<Note>* passed_over_;
  std::vector<Node> nodes_;
};

}  // namespace

Result<ObjectPtr> resolve(std::vector<Draft>& drafts, std::size_t root,
                          const std::map<std::string, std::size_t, std::less<>>& ids,
                          std::vector<Note>* passed_over) {
  Resolver resolver(drafts, ids, passed_over);
  Result<void> result = resolver.visit(root, 1, drafts[root].object->where);
  if (!result.ok()) {
    // A graph with a cycle would keep itself alive.
    for (Draft& draft : drafts) draft.object->children.clear();
    return std::move(result).error();
  }
  return ObjectPtr(drafts[root].object);
}

Note passed_over_note(const Error& error) {
  const std::string mend = error.mend.empty() ? std::string() : fmt::format(" ({})", error.mend);
  return {{error.file, error.line}, fmt::format("{}: it is passed over{}", error.message, mend)};
}

}  // namespace candela::description
