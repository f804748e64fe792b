#include "master/http/post.h"

#include <curl/curl.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string_view>

namespace candela::master {
namespace {

constexpr std::size_t kMaxAnswerBytes = 64 << 10;
constexpr double kConnectSeconds = 5;

struct Freer {
  void operator()(CURL* curl) const { curl_easy_cleanup(curl); }
  void operator()(CURLU* url) const { curl_url_cleanup(url); }
  void operator()(curl_slist* list) const { curl_slist_free_all(list); }
  void operator()(char* text) const { curl_free(text); }
};

std::string part_of(CURLU* url, CURLUPart part) {
  char* text = nullptr;
  if (curl_url_get(url, part, &text, 0) != CURLUE_OK) return {};
  const std::unique_ptr<char, Freer> owner(text);
  return text;
}

bool is_loopback(std::string_view host) {
  const bool numeric = host.find_first_not_of("0123456789.") == std::string_view::npos;
  return host == "localhost" || host == "[::1]" || (numeric && host.starts_with("127."));
}

// Counts the bytes of an answer, which nobody reads. Too many end the call.
std::size_t count_bytes(char*, std::size_t, std::size_t count, void* bytes) {
  auto& sum = *static_cast<std::size_t*>(bytes);
  sum += count;
  return sum > kMaxAnswerBytes ? 0 : count;
}

int ask_to_go_on(void* request, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  const auto& give_up = static_cast<const PostRequest*>(request)->give_up;
  return give_up && give_up() ? 1 : 0;
}

class CurlPoster final : public Poster {
 public:
  CurlPoster() : ready_(curl_global_init(CURL_GLOBAL_DEFAULT) == CURLE_OK) {}

  Target check(const std::string& url) const override {
    const std::unique_ptr<CURLU, Freer> parsed(curl_url());
    const bool printable = std::all_of(url.begin(), url.end(), [](char c) { return c > ' ' && c < '\x7f'; });
    // libcurl takes the first part of the path for the host where that is missing.
    const bool hostless = url.find(":///") != std::string::npos;
    if (!parsed || !printable || hostless ||
        curl_url_set(parsed.get(), CURLUPART_URL, url.c_str(), 0) != CURLUE_OK)
      return {"this is no URL", false};
    const std::string scheme = part_of(parsed.get(), CURLUPART_SCHEME);
    if (scheme != "http" && scheme != "https") return {"neither http:// nor https://", false};
    return {"", scheme == "http" && !is_loopback(part_of(parsed.get(), CURLUPART_HOST))};
  }

  PostAnswer post(const PostRequest& request) const override {
    const std::unique_ptr<CURL, Freer> curl(ready_ ? curl_easy_init() : nullptr);
    const std::unique_ptr<CURLU, Freer> url(curl_url());
    std::unique_ptr<curl_slist, Freer> fields;
    const auto add = [&](const std::string& field) {
      curl_slist* longer = curl_slist_append(fields.get(), field.c_str());
      if (longer == nullptr) return false;
      static_cast<void>(fields.release());
      fields.reset(longer);
      return true;
    };
    // Without "Expect:" libcurl would wait for the receiver's leave to send a long body.
    bool made = curl != nullptr && url != nullptr && add("Expect:");
    for (const std::string& field : request.fields) made = made && add(field);
    if (!made) return {0, "out of memory"};
    std::array<char, CURL_ERROR_SIZE> error{};
    std::size_t bytes = 0;
    CURL* const c = curl.get();
    curl_easy_setopt(c, CURLOPT_URL, request.url.c_str());
    curl_easy_setopt(c, CURLOPT_PROTOCOLS_STR, "http,https");
    curl_easy_setopt(c, CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(request.body.size()));
    curl_easy_setopt(c, CURLOPT_POSTFIELDS, request.body.data());
    curl_easy_setopt(c, CURLOPT_HTTPHEADER, fields.get());
    curl_easy_setopt(c, CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(c, CURLOPT_TIMEOUT_MS, static_cast<long>(request.timeout_seconds * 1000));
    curl_easy_setopt(c, CURLOPT_CONNECTTIMEOUT_MS,
                     static_cast<long>(std::min(kConnectSeconds, request.timeout_seconds) * 1000));
    curl_easy_setopt(c, CURLOPT_WRITEFUNCTION, &count_bytes);
    curl_easy_setopt(c, CURLOPT_WRITEDATA, &bytes);
    curl_easy_setopt(c, CURLOPT_NOPROGRESS, 0L);
    curl_easy_setopt(c, CURLOPT_XFERINFOFUNCTION, &ask_to_go_on);
    curl_easy_setopt(c, CURLOPT_XFERINFODATA, &request);
    curl_easy_setopt(c, CURLOPT_ERRORBUFFER, error.data());
    if (curl_url_set(url.get(), CURLUPART_URL, request.url.c_str(), 0) == CURLUE_OK &&
        is_loopback(part_of(url.get(), CURLUPART_HOST)))
      curl_easy_setopt(c, CURLOPT_PROXY, "");  // $http_proxy is for other machines
    const CURLcode result = curl_easy_perform(c);
    long code = 0;
    curl_easy_getinfo(c, CURLINFO_RESPONSE_CODE, &code);
    if (result == CURLE_OK || bytes > kMaxAnswerBytes) return {static_cast<int>(code), {}};
    return {0, error[0] != '\0' ? std::string(error.data()) : std::string(curl_easy_strerror(result))};
  }

 private:
  const bool ready_;
};

}  // namespace
}  // namespace candela::master

extern "C" const candela::master::Poster* candela_poster_1() {
  static const candela::master::CurlPoster poster;
  return &poster;
}
