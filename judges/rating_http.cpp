#include "judges/rating_http.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <atomic>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <fstream>
#include <system_error>
#include <thread>
#include <utility>

#include "core/error.h"

namespace evac {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using Tcp = asio::ip::tcp;
using Seconds = std::chrono::seconds;
using Parser = http::request_parser<http::string_body>;
using Response = http::response<http::string_body>;

std::string Text(const Parser& parser, beast::string_view name) {
  const auto found = parser.get().find(name);
  return found == parser.get().end() ? "" : std::string(found->value());
}

HttpAsked AskedBy(const Parser& parser, const std::string& peer) {
  const std::string target(parser.get().target());
  const std::size_t mark = target.find('?');
  HttpAsked asked;
  asked.method = std::string(parser.get().method_string());
  asked.path = target.substr(0, mark);
  asked.query = mark == std::string::npos ? "" : target.substr(mark + 1);
  asked.host = Text(parser, "Host");
  asked.origin = Text(parser, "Origin");
  asked.cookie = Text(parser, "Cookie");
  asked.range = Text(parser, "Range");
  asked.content_type = Text(parser, "Content-Type");
  asked.csrf = Text(parser, "X-Evac-Csrf");
  asked.user_agent = Text(parser, "User-Agent");
  asked.fetch_site = Text(parser, "Sec-Fetch-Site");
  asked.body = parser.get().body();
  asked.peer = peer;
  return asked;
}

/// Lengths that two programs could read in two ways are no requests.
bool IsAmbiguous(const Parser& parser) {
  const auto& fields = parser.get();
  const auto lengths = fields.equal_range(http::field::content_length);
  const auto hosts = fields.equal_range(http::field::host);
  return fields.count(http::field::transfer_encoding) > 0 || std::distance(lengths.first, lengths.second) > 1 ||
         std::distance(hosts.first, hosts.second) != 1;
}

HttpAnswer Plain(int status) { return {status, "text/plain; charset=utf-8", fmt::format("{}\n", status)}; }

/// The bytes of a file that were asked for; 404 if it is gone.
HttpAnswer WithFile(HttpAnswer answer) {
  std::ifstream stream(*answer.file, std::ios::binary | std::ios::ate);
  if (!stream) return Plain(404);
  const auto size = static_cast<std::uint64_t>(stream.tellg());
  const ByteRange part = answer.part.value_or(ByteRange{0, size});
  if (part.first > size || part.count > size - part.first) {
    HttpAnswer refusal = Plain(416);
    refusal.headers.emplace_back("Content-Range", fmt::format("bytes */{}", size));
    return refusal;
  }
  answer.body.resize(part.count);
  stream.seekg(static_cast<std::streamoff>(part.first));
  stream.read(answer.body.data(), static_cast<std::streamsize>(part.count));
  return answer;
}

Response ResponseOf(HttpAnswer answer, bool keep_alive) {
  if (answer.file) answer = WithFile(std::move(answer));
  Response response{static_cast<http::status>(answer.status), 11};
  for (const auto& [name, value] : answer.headers) response.set(name, value);
  response.set(http::field::content_type, answer.content_type);
  response.body() = std::move(answer.body);
  response.keep_alive(keep_alive);
  response.prepare_payload();
  return response;
}

int StatusOf(beast::error_code error) {
  if (error == http::error::header_limit) return 431;
  if (error == http::error::body_limit) return 413;
  return 400;
}

bool IsMalformed(beast::error_code error) {
  return error.category() == http::make_error_code(http::error::bad_method).category() &&
         error != http::error::end_of_stream && error != http::error::partial_message;
}

}  // namespace

struct RatingHttp::Impl {
  Impl(const std::string& host, int port, const HttpServerLimits& given, Handler answerer)
      : limits(given), handler(std::move(answerer)), acceptor(io) {
    beast::error_code error;
    Tcp::resolver resolver(io);
    const auto found = resolver.resolve(host, std::to_string(port), error);
    if (error || found.empty()) throw InvalidInput("--host: '{}' is no address: {}", host, error.message());
    const Tcp::endpoint endpoint = *found.begin();
    acceptor.open(endpoint.protocol());
    acceptor.set_option(asio::socket_base::reuse_address(true));
    acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
    if (error) throw InvalidInput("{}:{} cannot be listened at: {}", host, port, error.message());
  }

  asio::awaitable<void> Accept() {
    for (;;) {
      beast::error_code error;
      Tcp::socket socket =
          co_await acceptor.async_accept(asio::make_strand(io), asio::redirect_error(asio::use_awaitable, error));
      if (error == asio::error::operation_aborted) co_return;
      if (error) {  // no descriptors left: wait until some connection ends
        asio::steady_timer pause(io, std::chrono::milliseconds(50));
        co_await pause.async_wait(asio::redirect_error(asio::use_awaitable, error));
        continue;
      }
      if (open.load() >= limits.connections) continue;  // closes it
      ++open;
      const auto executor = socket.get_executor();
      asio::co_spawn(executor, Talk(std::move(socket)), [this](std::exception_ptr) { --open; });
    }
  }

  /// One connection, request after request.
  asio::awaitable<void> Talk(Tcp::socket socket) {
    beast::error_code error;
    const auto end = socket.remote_endpoint(error);
    const std::string peer = error ? "" : end.address().to_string();
    socket.set_option(Tcp::no_delay(true), error);
    beast::tcp_stream stream(std::move(socket));
    beast::flat_buffer buffer(limits.header_bytes + limits.body_bytes);
    for (bool go_on = true; go_on;) {
      if (buffer.size() == 0) {  // idle until the first byte; then the clock of a request runs
        stream.expires_after(Seconds(limits.idle_s));
        const std::size_t count =
            co_await stream.async_read_some(buffer.prepare(2048), asio::redirect_error(asio::use_awaitable, error));
        if (error) break;
        buffer.commit(count);
      }
      go_on = co_await AnswerOne(stream, buffer, peer);
    }
    stream.socket().shutdown(Tcp::socket::shutdown_send, error);
  }

  /// @returns whether the connection may be used again.
  asio::awaitable<bool> AnswerOne(beast::tcp_stream& stream, beast::flat_buffer& buffer, const std::string& peer) {
    beast::error_code error;
    Parser parser;
    parser.header_limit(static_cast<std::uint32_t>(limits.header_bytes));
    parser.body_limit(limits.body_bytes);
    stream.expires_after(Seconds(limits.request_s));
    co_await http::async_read(stream, buffer, parser, asio::redirect_error(asio::use_awaitable, error));
    HttpAnswer answer;
    const bool is_bad = error ? IsMalformed(error) : IsAmbiguous(parser);
    if (error && !is_bad) co_return false;
    bool keep_alive = false;
    if (is_bad) {
      answer = Plain(error ? StatusOf(error) : 400);
    } else {
      keep_alive = parser.keep_alive();
      answer = co_await Ask(AskedBy(parser, peer));
    }
    Response response = ResponseOf(std::move(answer), keep_alive);
    if (parser.get().method() == http::verb::head) response.body().clear();
    error = co_await Send(stream, response);
    co_return !error && keep_alive;
  }

  /// The clock begins anew with every piece that is taken: a clip over a thin line takes longer than any fixed time.
  asio::awaitable<beast::error_code> Send(beast::tcp_stream& stream, const Response& response) {
    beast::error_code error;
    http::response_serializer<http::string_body> pieces(response);
    while (!error && !pieces.is_done()) {
      stream.expires_after(Seconds(limits.answer_s));
      co_await http::async_write_some(stream, pieces, asio::redirect_error(asio::use_awaitable, error));
    }
    co_return error;
  }

  asio::awaitable<HttpAnswer> Ask(HttpAsked asked) {
    return asio::async_initiate<const asio::use_awaitable_t<>, void(HttpAnswer)>(
        [this](auto done, HttpAsked what) {
          // std::function wants to be copied, the rest of a coroutine cannot be.
          const auto rest = std::make_shared<decltype(done)>(std::move(done));
          handler(std::move(what), [rest](HttpAnswer answer) {
            const auto executor = asio::get_associated_executor(*rest);
            asio::post(executor, [rest, given = std::move(answer)]() mutable { std::move (*rest)(std::move(given)); });
          });
        },
        asio::use_awaitable, std::move(asked));
  }

  HttpServerLimits limits;
  Handler handler;
  asio::io_context io;
  Tcp::acceptor acceptor;
  std::atomic<std::size_t> open = 0;
};

RatingHttp::RatingHttp(const std::string& host, int port, const HttpServerLimits& limits, Handler handler)
    : impl_(std::make_unique<Impl>(host, port, limits, std::move(handler))) {}

RatingHttp::~RatingHttp() { Stop(); }

int RatingHttp::port() const { return impl_->acceptor.local_endpoint().port(); }

void RatingHttp::Serve() {
  asio::co_spawn(impl_->io, impl_->Accept(), asio::detached);
  std::vector<std::thread> threads;
  try {
    for (int i = 1; i < impl_->limits.threads; ++i) threads.emplace_back([this] { impl_->io.run(); });
  } catch (const std::system_error& error) {  // this one answers too
    spdlog::warn("rating: {} of {} threads: {}", threads.size() + 1, impl_->limits.threads, error.what());
  }
  impl_->io.run();
  for (std::thread& thread : threads) thread.join();
}

void RatingHttp::Stop() { impl_->io.stop(); }

}  // namespace evac
