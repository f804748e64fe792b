// Certificates of a farm, and of one that is none of ours, made with the openssl command.
#pragma once

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace candela::farm {

class Certificates {
 public:
  explicit Certificates(std::filesystem::path folder) : folder_(std::move(folder)) {
    authority("ca");
    certificate("ca", "server");
    certificate("ca", "client");
    authority("other-ca");
    certificate("other-ca", "stranger");
  }
  std::vector<std::string> options(const std::string& name, const std::string& ca = "ca") const {
    return {"--tls-cert",        file(name + ".pem"), "--tls-key",
            file(name + ".key"), "--tls-ca",          file(ca + ".pem")};
  }
  std::string file(const std::string& name) const { return (folder_ / name).string(); }
  bool made() const { return made_; }

 private:
  void openssl(const std::string& arguments) {
    made_ =
        made_ &&
        std::system(
            fmt::format("cd '{}' && openssl {} >/dev/null 2>&1", folder_.string(), arguments).c_str()) == 0;
  }
  void authority(const std::string& name) {
    openssl(fmt::format(
        "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN={0} -keyout {0}.key "
        "-out {0}.pem",
        name));
  }
  void certificate(const std::string& ca, const std::string& name) {
    std::ofstream(folder_ / (name + ".ext"))
        << "subjectAltName=DNS:localhost,IP:127.0.0.1,URI:candela:role/worker,URI:candela:role/operate\n";
    openssl(fmt::format(
        "req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj /CN={0} -keyout {0}.key -out {0}.csr",
        name));
    openssl(
        fmt::format("x509 -req -days 2 -in {0}.csr -CA {1}.pem -CAkey {1}.key -CAcreateserial -extfile "
                    "{0}.ext -out {0}.pem",
                    name, ca));
  }
  std::filesystem::path folder_;
  bool made_ = true;
};

}  // namespace candela::farm
