// All of films at once, for tests that stand on both sides. The product includes what it uses: a worker
// unit_film.h and delta.h, the master merged_film.h and delta.h.
#pragma once

#include "common/film/counts.h"
#include "common/film/delta.h"
#include "common/film/index_set.h"
#include "common/film/layout.h"
#include "common/film/merged_film.h"
#include "common/film/quantise.h"
#include "common/film/unit_film.h"
