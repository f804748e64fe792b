// The whole `candela` program behind main: parser, commands, errors to exit codes. A test can run it in its
// own process.
#pragma once

#include <iosfwd>
#include <memory>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace candela::client {

struct Context;

// The parser of all commands. To parse a command line sets context.command, and does nothing else.
std::unique_ptr<CLI::App> make_parser(Context& context);

// arguments[0] is the program's name. Returns the exit code (see docs/cli.md); errors are one line each on
// `err`.
int run_program(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err);

}  // namespace candela::client
