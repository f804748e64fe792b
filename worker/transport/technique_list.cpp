#include "worker/transport/technique_list.h"

namespace candela::transport {

double TechniqueList::weight(MisHeuristic heuristic) const {
  double largest = 1;
  for (const double other : others_) largest = std::max(largest, other);
  double sum = 0;
  switch (heuristic) {
    case MisHeuristic::balance:
      for (const double other : others_) sum += other;
      return 1 / (1 + sum);
    case MisHeuristic::power:
      for (const double other : others_) sum += other * other;
      return 1 / (1 + sum);
    case MisHeuristic::maximum: {
      const double least = largest * (1 - kTie);
      if (1 < least) return 0;
      for (const double other : others_) sum += other < least ? 0 : 1;
      return 1 / (1 + sum);
    }
    case MisHeuristic::cutoff: {
      const double least = largest * kCutoff;
      if (1 < least) return 0;
      for (const double other : others_) sum += other < least ? 0 : other;
      return 1 / (1 + sum);
    }
  }
  return 0;
}

}  // namespace candela::transport
