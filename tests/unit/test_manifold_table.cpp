// Claim: frames, blocks, solutions and contributions are those of the table half-vector.csv to 1e-10.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "tests/paths.h"
#include "tests/unit/manifold_chains.h"
#include "tests/unit/manifold_geometry.h"
#include "worker/transport/manifold/block_tridiagonal.h"

namespace candela {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace)

struct Row {
  std::map<std::string, std::string> cells;
  double number(const std::string& name) const { return std::stod(cells.at(name)); }
  Vec3d vector(const std::string& name) const {
    return {number(name + "_x"), number(name + "_y"), number(name + "_z")};
  }
  Mat2 matrix(const std::string& name) const {
    return {number(name + "_00"), number(name + "_01"), number(name + "_10"), number(name + "_11")};
  }
};

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> cells;
  std::stringstream stream(line.substr(0, line.find('\r')));
  for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
  return cells;
}

constexpr double kError = 1e-10;

void near(double a, double b, double scale, const char* what) {
  EXPECT_LE(std::abs(a - b), kError * std::max(scale, std::abs(b))) << what << ": " << a << ", not " << b;
}
void near(const Mat2& a, const Mat2& b, const char* what) {
  EXPECT_LE(std::sqrt(norm_squared(a - b)), kError * std::max(1e-3, std::sqrt(norm_squared(b)))) << what;
}
void near(Vec3d a, Vec3d b, const char* what) {
  EXPECT_LE(length(a - b), kError) << what;
}

Chain chain_of(const std::vector<Row>& rows) {
  Chain chain;
  const std::string& surface = rows[0].cells.at("surface");
  chain.first = surface == "area"          ? FirstEnd::surface
                : surface == "directional" ? FirstEnd::direction
                                           : FirstEnd::point;
  for (const Row& row : rows) {
    ChainVertex v;
    v.x = row.vector("x");
    v.ng = row.vector("ng");
    v.n = row.vector("n");
    v.p_u = row.vector("pu");
    v.p_v = row.vector("pv");
    v.n_u = row.vector("nu");
    v.n_v = row.vector("nv");
    v.eta = row.number("eta");
    const std::string& kind = row.cells.at("kind");
    v.scatter = kind == "reflect" ? Scatter::reflect : kind == "refract" ? Scatter::refract : Scatter::end;
    chain.vertices.push_back(v);
  }
  return chain;
}

void compare_form(Form form, const std::string& suffix, const Chain& chain, const std::vector<Row>& rows) {
  const std::vector<Blocks> all = blocks(form, chain);
  for (std::size_t i = 1; i <= chain.inner_count(); ++i) {
    const Row& row = rows[i];
    near(all[i - 1].a, row.matrix("A" + suffix), "A");
    near(all[i - 1].b, row.matrix("B" + suffix), "B");
    near(all[i - 1].c, row.matrix("C" + suffix), "C");
    const Pair c = constraint(form, chain, i);
    const std::string name = form == Form::slope ? "slope" : "disk";
    near(c.x, row.number(name + "_s"), 1e-3, "c");
    near(c.y, row.number(name + "_t"), 1e-3, "c");
  }
  BlockTridiagonal factored;
  ASSERT_TRUE(factored.factor(all));
  const std::string name = form == Form::slope ? "slope" : "disk";
  near(factored.det(), rows[0].number("det_J_" + name), 0, "|J|");
  near(std::exp(factored.log_abs_det()), std::abs(factored.det()), 0, "log |J|");
  near(std::exp(log_contribution(form, chain)), rows[0].number("contribution_" + name), 0, "contribution");
  if (form == Form::disk) return;  // T does not know the form; the table's D is that of slopes
  const auto t = factored.by_last_end(), d = factored.last_vertex_by_constraints();
  for (std::size_t i = 1; i <= chain.inner_count(); ++i) {
    near(t[i - 1], rows[i].matrix("T"), "T");
    near(d[i - 1], rows[i].matrix("D"), "D");
  }
  near(det(t.front()), rows[0].number("det_T1"), 0, "det T_1");
  near(std::exp(log_pencil(chain)), rows[0].number("G_0") * std::abs(rows[0].number("det_T1")), 0, "pencil");
}

void compare(const std::vector<Row>& rows) {
  SCOPED_TRACE("path " + rows[0].cells.at("path"));
  const Chain chain = chain_of(rows);
  EXPECT_EQ(fault_of(chain), Fault::none);
  double product = 1;
  for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
    const double g = geometry_term(chain, i);
    near(g, rows[i].number("G_next"), 0, "G");
    product *= g;
  }
  near(product, rows[0].number("prod_G"), 0, "prod G");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto [s, t] = pole_frame(chain.vertices[i].n);
    near(s, rows[i].vector("s"), "s");
    near(t, rows[i].vector("t"), "t");
    if (chain.vertices[i].scatter == Scatter::end) continue;
    near(spin(chain.vertices[i].n, chain.vertices[i].n_u), rows[i].number("kappa_u"), 1e-2, "spin");
    near(spin(chain.vertices[i].n, chain.vertices[i].n_v), rows[i].number("kappa_v"), 1e-2, "spin");
    near(half_cosine(chain, i), rows[i].number("h_dot_n"), 0, "h.n");
    near(projected_by_constraint(Form::disk, chain, i), rows[i].number("do_dh_perp"), 0, "do/dh");
  }
  compare_form(Form::slope, "s", chain, rows);
  compare_form(Form::disk, "d", chain, rows);
}

TEST(HalfVectorTable, HoldsToTenDigits) {
  std::ifstream file(test::shared_path() / "theory" / "half-vector.csv");
  if (!file) GTEST_SKIP() << "no half-vector.csv in " << test::shared_path() / "theory";
  std::string line;
  std::getline(file, line);
  const std::vector<std::string> names = split(line);
  std::map<std::string, std::vector<Row>> paths;
  while (std::getline(file, line)) {
    const std::vector<std::string> cells = split(line);
    ASSERT_EQ(cells.size(), names.size());
    Row row;
    for (std::size_t i = 0; i < names.size(); ++i) row.cells[names[i]] = cells[i];
    paths[row.cells.at("path")].push_back(row);
  }
  ASSERT_EQ(paths.size(), 48u);
  for (const auto& [name, rows] : paths) compare(rows);
}

}  // namespace
}  // namespace candela
