#include "reports/dashboard.h"

#include <fmt/format.h>
#include <httplib.h>
#include <sys/socket.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>

#include "core/error.h"
#include "reports/dashboard_paths.h"
#include "reports/dashboard_run.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr int kMostListeners = 24;  // to /events: each holds a thread
constexpr int kThreads = 32;
constexpr std::size_t kPiece = 1 << 18;

/// Sends a file piece by piece, with the ranges that a player asks for.
void SendFile(const fs::path& file, const char* type, httplib::Response& response) {
  std::error_code error;
  const auto size = fs::file_size(file, error);
  if (error) {
    response.status = 404;
    return;
  }
  response.set_content_provider(size, type, [file](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
    std::string bytes(std::min(length, kPiece), '\0');
    std::ifstream stream(file, std::ios::binary);
    stream.seekg(static_cast<std::streamoff>(offset));
    stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return stream.gcount() > 0 && sink.write(bytes.data(), static_cast<std::size_t>(stream.gcount()));
  });
}

/// Instead of httplib's own choice, SO_REUSEPORT, by which two programs share a port and each gets some requests. An
/// address that nobody listens at any more is free at once.
void TakeFreeAddressAlone(socket_t socket) {
  const int yes = 1;
  ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
}

bool IsLoopback(const std::string& host) { return host == "localhost" || host == "::1" || host.starts_with("127."); }

}  // namespace

struct Dashboard::Server {
  explicit Server(DashboardOptions given) : options(std::move(given)) {
    if (!(options.look_every_s > 0 && options.look_every_s <= 3600))
      throw InvalidInput("dashboard: look every {} s, wanted a number in (0, 3600]", options.look_every_s);
    for (const fs::path& run : options.runs)
      runs.push_back(std::make_unique<WatchedRun>(run, runs.size(), options.summary, options.program));
    Listen();
  }

  void Listen() {
    http.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };  // httplib deletes it
    http.set_default_headers({{"X-Content-Type-Options", "nosniff"},
                              {"X-Frame-Options", "DENY"},
                              {"Referrer-Policy", "no-referrer"},
                              {"Cross-Origin-Resource-Policy", "same-origin"},
                              {"Cache-Control", "no-store"}});
    http.set_payload_max_length(1 << 16);
    http.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      Answer(request, response);
      return httplib::Server::HandlerResponse::Handled;
    });
    http.set_socket_options(TakeFreeAddressAlone);
    port = options.port == 0 ? http.bind_to_any_port(options.host)
                             : (http.bind_to_port(options.host, options.port) ? options.port : -1);
    if (port < 0) throw InvalidInput("dashboard: {}:{} cannot be listened at", options.host, options.port);
  }

  void Answer(const httplib::Request& request, httplib::Response& response) noexcept try {
    const auto path = ParseDashboardPath(request.path);
    if (request.method != "GET" && request.method != "HEAD") {
      response.status = 405;
      response.set_header("Allow", "GET, HEAD");
    } else if (IsLoopback(options.host) && !IsLoopbackHost(request.get_header_value("Host"), options.host)) {
      response.status = 403;
    } else if (!path || (path->view >= DashboardView::kPage && path->run >= runs.size())) {
      response.status = 404;
    } else {
      Show(*path, response);
    }
  } catch (const std::exception&) {  // nothing may be thrown through httplib
    response.status = 500;
  }

  void Show(const DashboardPath& path, httplib::Response& response) {
    switch (path.view) {
      case DashboardView::kIndex:
        return response.set_content(DashboardIndex(Summaries(), options.program), "text/html; charset=utf-8");
      case DashboardView::kHistory:
        return response.set_content(Dumped(DashboardHistory(Summaries())), "application/json");
      case DashboardView::kEvents:
        return Tell(response);
      case DashboardView::kPage:
        return response.set_content(runs[path.run]->Now().page, "text/html; charset=utf-8");
      case DashboardView::kJson:
        return response.set_content(runs[path.run]->Now().json, "application/json");
      case DashboardView::kFile:
        if (const auto file = runs[path.run]->FileOf(path.file))
          return SendFile(*file, path.file.ends_with(".mp4") ? "video/mp4" : "image/jpeg", response);
        response.status = 404;
    }
  }

  std::vector<DashboardRun> Summaries() {
    std::vector<DashboardRun> summaries;
    for (const auto& run : runs) summaries.push_back(run->Now().summary);
    return summaries;
  }

  static std::string Dumped(const nlohmann::ordered_json& json) {
    return json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  }

  /// What /events says: one stamp per run, which differs when there is news.
  std::string News() const {
    nlohmann::ordered_json stamps = nlohmann::ordered_json::array();
    for (const auto& run : runs) stamps.push_back(StampOf(run->folder()));
    return nlohmann::ordered_json{{"runs", stamps}}.dump();
  }

  /// A stream that speaks when a store changes, and draws breath now and then so that a listener who left is noticed.
  void Tell(httplib::Response& response) {
    if (listeners.fetch_add(1) >= kMostListeners) {
      --listeners;
      response.status = 503;
      return;
    }
    response.set_chunked_content_provider(
        "text/event-stream",
        [this, last = std::string(), silent = 0](std::size_t, httplib::DataSink& sink) mutable {
          const std::string news = News();
          const bool is_news = news != last, must_breathe = ++silent * options.look_every_s >= 10;
          if (is_news || must_breathe) {
            silent = 0;
            const std::string text = is_news ? "data: " + news + "\n\n" : ":\n\n";
            if (!sink.write(text.data(), text.size())) return false;
            last = news;
          }
          return WaitALittle();
        },
        [this](bool) { --listeners; });
  }

  /// @returns whether to go on.
  bool WaitALittle() const {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(options.look_every_s);
    while (!stopped && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    return !stopped;
  }

  DashboardOptions options;
  std::vector<std::unique_ptr<WatchedRun>> runs;
  httplib::Server http;
  int port = -1;
  std::atomic<bool> serving = false, stopped = false;
  std::atomic<int> listeners = 0;
};

Dashboard::Dashboard(DashboardOptions options) : server_(std::make_unique<Server>(std::move(options))) {}

Dashboard::~Dashboard() { Stop(); }

int Dashboard::port() const { return server_->port; }

std::string Dashboard::url() const {
  const std::string& host = server_->options.host;
  return fmt::format("http://{}:{}/", host.find(':') == std::string::npos ? host : "[" + host + "]", port());
}

void Dashboard::Serve() {
  server_->serving = true;
  if (!server_->stopped) server_->http.listen_after_bind();
  server_->serving = false;
  if (!server_->stopped) throw InternalError("dashboard: {} cannot be listened at any more", url());
}

void Dashboard::Stop() {
  server_->stopped = true;
  while (server_->serving && !server_->http.is_running())  // about to listen: httplib would not hear a stop now
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  server_->http.stop();
}

}  // namespace evac
