// The tools of candela inspect, each added to that command's parser.
#pragma once

namespace CLI {
class App;
}

namespace candela::client {

struct Context;

void add_falsecolor(CLI::App& inspect, Context& context);

}  // namespace candela::client
