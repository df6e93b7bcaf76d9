// A client of the context manager of CoDRA DSL, for programs in C++17 on Linux. Compile with -pthread.
//
// The how-to guide docs/how-to/cpp.md shows its use. Its messages are those of docs/reference/messages.md, version 1.

#ifndef CODRA_HPP
#define CODRA_HPP

#include <arpa/inet.h>
#include <cxxabi.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <fstream>
#include <functional>
#include <iomanip>
#include <iostream>
#include <limits>
#include <locale>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <typeinfo>
#include <utility>
#include <variant>
#include <vector>

namespace codra {

/// A value of a variable; `std::monostate` stands for unknown.
using Value = std::variant<std::monostate, bool, std::int64_t, double, std::string>;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// The manager has refused a request.
class Error : public std::runtime_error {
 public:
  Error(std::string kind, const std::string& message) : std::runtime_error(message), kind_(std::move(kind)) {}

  /// The kind of the error, such as "unknown_name": the reference of messages lists all kinds.
  const std::string& kind() const noexcept { return kind_; }

 private:
  std::string kind_;
};

/// The manager cannot be reached, does not answer, or has ended the connection. The kind is "unreachable".
class ConnectionError : public Error {
 public:
  explicit ConnectionError(const std::string& message) : Error("unreachable", message) {}
};

/// What context knows about a variable. Instants are seconds on the manager's clock.
struct Reading {
  std::string variable;
  Value value;
  std::string reason;  ///< why the value is unknown; empty if it is known
  std::string detail;
  std::string source;
  std::optional<double> evidence_s, start_s, identified_s, expires_s;

  bool known() const { return !std::holds_alternative<std::monostate>(value); }
};

enum class Outcome { holds, violated, unknown };

struct UnknownVariable {
  std::string variable, reason, detail;
};

/// The answer to the preview of a skill.
struct Preview {
  std::string skill;
  Outcome outcome = Outcome::unknown;
  std::vector<std::string> violated, undecided;
  std::vector<UnknownVariable> unknown;
};

/// Limits of a decision or a preview: which evidence counts, and how long the manager may wait for observers.
struct Limits {
  double max_age_s = infinity;
  double since_s = -infinity;
  double wait_up_to_s = 0.0;
};

namespace detail {

struct Json;
using JsonArray = std::vector<Json>;
using JsonObject = std::vector<std::pair<std::string, Json>>;

/// A value of JSON. An integer of more than 64 bits is a double.
struct Json {
  std::variant<std::monostate, bool, std::int64_t, double, std::string, JsonArray, JsonObject> content;

  /// The field of an object; null if there is none. The last of several fields with one name counts.
  const Json* find(std::string_view name) const {
    const auto* fields = std::get_if<JsonObject>(&content);
    if (fields == nullptr) return nullptr;
    const auto field = std::find_if(fields->rbegin(), fields->rend(), [&](const auto& f) { return f.first == name; });
    return field == fields->rend() ? nullptr : &field->second;
  }

  template <typename T>
  const T& get(const char* name) const {
    const Json* field = find(name);
    if (field != nullptr && std::holds_alternative<T>(field->content)) return std::get<T>(field->content);
    throw Error("malformed", std::string("a message of the manager has no valid field `") + name + "`");
  }

  std::optional<double> number(std::string_view name) const {
    const Json* field = find(name);
    if (field == nullptr) return std::nullopt;
    if (const auto* integer = std::get_if<std::int64_t>(&field->content)) return static_cast<double>(*integer);
    const auto* real = std::get_if<double>(&field->content);
    return real == nullptr ? std::nullopt : std::optional<double>(*real);
  }
};

/// The number of bytes of the first character in UTF-8; 0 if it is malformed. Surrogates count as characters, because
/// JSON can state them by escapes.
inline std::size_t character_bytes(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  const auto continues = [&](std::size_t i) { return (byte(i) & 0xC0U) == 0x80U; };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  if (!continues(1) || first < 0xC2 || first > 0xF4) return 0;
  if (first < 0xE0) return 2;
  if (!continues(2) || (first == 0xE0 && byte(1) < 0xA0)) return 0;
  if (first < 0xF0) return 3;
  const bool is_in_range = (first != 0xF0 || byte(1) >= 0x90) && (first != 0xF4 || byte(1) < 0x90);
  return continues(3) && is_in_range ? 4 : 0;
}

/// Parses the JSON text of one value.
class JsonParser {
 public:
  /// Throws Error of kind "malformed" if the text is not JSON, or is nested too deeply.
  static Json parse(std::string_view text) {
    JsonParser parser(text);
    Json value = parser.parse_value(0);
    parser.skip_spaces();
    if (!parser.rest_.empty()) parser.fail("there is text after the value");
    return value;
  }

 private:
  static constexpr int max_depth = 32;

  explicit JsonParser(std::string_view text) : rest_(text), size_(text.size()) {}

  [[noreturn]] void fail(const char* problem) const {
    throw Error("malformed", "not JSON, at byte " + std::to_string(size_ - rest_.size()) + ": " + problem);
  }

  bool skip(std::string_view token) {
    const bool is_next = rest_.substr(0, token.size()) == token;
    if (is_next) rest_.remove_prefix(token.size());
    return is_next;
  }

  void skip_spaces() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t\r\n"), rest_.size())); }

  bool skip_after_spaces(std::string_view token) {
    skip_spaces();
    return skip(token);
  }

  Json parse_value(int depth) {
    if (depth >= max_depth) fail("it is nested too deeply");
    skip_spaces();
    if (skip("{")) return Json{parse_object(depth)};
    if (skip("[")) return Json{parse_array(depth)};
    if (skip("\"")) return Json{parse_text()};
    if (skip("true")) return Json{true};
    if (skip("false")) return Json{false};
    if (skip("null")) return Json{};
    return parse_number();
  }

  JsonObject parse_object(int depth) {
    JsonObject fields;
    if (skip_after_spaces("}")) return fields;
    do {
      if (!skip_after_spaces("\"")) fail("a name is missing");
      std::string name = parse_text();
      if (!skip_after_spaces(":")) fail("a colon is missing");
      fields.emplace_back(std::move(name), parse_value(depth + 1));
    } while (skip_after_spaces(","));
    if (!skip_after_spaces("}")) fail("a brace is missing");
    return fields;
  }

  JsonArray parse_array(int depth) {
    JsonArray elements;
    if (skip_after_spaces("]")) return elements;
    do {
      elements.push_back(parse_value(depth + 1));
    } while (skip_after_spaces(","));
    if (!skip_after_spaces("]")) fail("a bracket is missing");
    return elements;
  }

  std::string parse_text() {
    std::string text;
    while (!skip("\"")) {
      if (skip("\\")) {
        parse_escape(text);
        continue;
      }
      const std::size_t bytes = rest_.empty() ? 0 : character_bytes(rest_);
      if (bytes == 0 || static_cast<unsigned char>(rest_[0]) < 0x20) fail("a text is not valid");
      text.append(rest_.substr(0, bytes));
      rest_.remove_prefix(bytes);
    }
    return text;
  }

  void parse_escape(std::string& text) {
    static constexpr std::string_view letters = "\"\\/bfnrt", characters = "\"\\/\b\f\n\r\t";
    const std::size_t i = rest_.empty() ? std::string_view::npos : letters.find(rest_[0]);
    if (i != std::string_view::npos) {
      text += characters[i];
      rest_.remove_prefix(1);
      return;
    }
    if (!skip("u")) fail("an escape is not valid");
    unsigned character = parse_four_digits();
    if (character >= 0xD800 && character < 0xDC00 && rest_.substr(0, 2) == "\\u") {
      const std::string_view before = rest_;
      rest_.remove_prefix(2);
      const unsigned low = parse_four_digits();
      if (low >= 0xDC00 && low < 0xE000) {
        character = 0x10000 + ((character - 0xD800) << 10) + (low - 0xDC00);
      } else {
        rest_ = before;
      }
    }
    append_character(text, character);
  }

  unsigned parse_four_digits() {
    unsigned number = 0;
    const std::string_view digits = rest_.substr(0, 4);
    const auto result = std::from_chars(digits.data(), digits.data() + digits.size(), number, 16);
    if (digits.size() < 4 || result.ptr != digits.data() + 4) fail("an escape is not valid");
    rest_.remove_prefix(4);
    return number;
  }

  static void append_character(std::string& text, unsigned character) {
    const auto continuation = [&](int shift) { text += static_cast<char>(0x80 | ((character >> shift) & 0x3F)); };
    if (character < 0x80) {
      text += static_cast<char>(character);
    } else if (character < 0x800) {
      text += static_cast<char>(0xC0 | (character >> 6));
    } else if (character < 0x10000) {
      text += static_cast<char>(0xE0 | (character >> 12));
      continuation(6);
    } else {
      text += static_cast<char>(0xF0 | (character >> 18));
      continuation(12);
      continuation(6);
    }
    if (character >= 0x80) continuation(0);
  }

  std::size_t skip_digits() {
    const std::size_t count = std::min(rest_.find_first_not_of("0123456789"), rest_.size());
    rest_.remove_prefix(count);
    return count;
  }

  Json parse_number() {
    const std::string_view start = rest_;
    skip("-");
    if (!skip("0") && skip_digits() == 0) fail("a value is missing");
    bool is_integer = true;
    if (skip(".")) {
      is_integer = false;
      if (skip_digits() == 0) fail("digits are missing");
    }
    if (skip("e") || skip("E")) {
      is_integer = false;
      if (!skip("+")) skip("-");
      if (skip_digits() == 0) fail("digits are missing");
    }
    const std::string_view text = start.substr(0, start.size() - rest_.size());
    std::int64_t integer = 0;
    if (is_integer && std::from_chars(text.data(), text.data() + text.size(), integer).ec == std::errc()) {
      return Json{integer};
    }
    std::istringstream stream{std::string(text)};
    stream.imbue(std::locale::classic());  // some locales have a decimal comma
    double real = 0;
    if (!(stream >> real)) fail("the number is too large");
    return Json{real};
  }

  std::string_view rest_;
  std::size_t size_;
};

/// Writes JSON text. Throws Error of kind "malformed" if a text is not UTF-8.
class JsonWriter {
 public:
  static std::string write(const Json& json) {
    JsonWriter writer;
    std::visit(writer, json.content);
    return std::move(writer.line_);
  }

  void operator()(std::monostate) { line_ += "null"; }
  void operator()(bool truth) { line_ += truth ? "true" : "false"; }
  void operator()(std::int64_t integer) { line_ += std::to_string(integer); }

  void operator()(double real) {
    if (!std::isfinite(real)) return (*this)(std::monostate());
    std::ostringstream stream;
    stream.imbue(std::locale::classic());
    stream << std::setprecision(std::numeric_limits<double>::max_digits10) << real;
    line_ += stream.str();
    if (stream.str().find_first_of(".e") == std::string::npos) line_ += ".0";
  }

  void operator()(const std::string& text) {
    static constexpr char digits[] = "0123456789abcdef";
    line_ += '"';
    for (std::string_view rest = text; !rest.empty();) {
      const std::size_t bytes = character_bytes(rest);
      if (bytes == 0) throw Error("malformed", "a text of the request is not UTF-8");
      const auto first = static_cast<unsigned char>(rest[0]);
      if (first < 0x20) {
        line_.append("\\u00").append(1, digits[first >> 4]).append(1, digits[first & 15]);
      } else {
        line_.append(first == '"' || first == '\\' ? "\\" : "").append(rest.substr(0, bytes));
      }
      rest.remove_prefix(bytes);
    }
    line_ += '"';
  }

  void operator()(const JsonArray& elements) {
    line_ += '[';
    for (const Json& element : elements) {
      if (&element != &elements.front()) line_ += ',';
      std::visit(*this, element.content);
    }
    line_ += ']';
  }

  void operator()(const JsonObject& fields) {
    line_ += '{';
    for (const auto& field : fields) {
      if (&field != &fields.front()) line_ += ',';
      (*this)(field.first);
      line_ += ':';
      std::visit(*this, field.second.content);
    }
    line_ += '}';
  }

 private:
  std::string line_;
};

/// Adds a field to a request, unless the value is unknown. JSON has no infinite numbers: the sign has a field instead.
inline void add(JsonObject& fields, const std::string& name, const Value& value) {
  const auto* real = std::get_if<double>(&value);
  if (real != nullptr && std::isinf(*real)) {
    const std::int64_t sign = *real > 0 ? 1 : -1;
    fields.emplace_back(name == "value" ? "infinite" : "infinite_" + name, Json{sign});
  } else if (!std::holds_alternative<std::monostate>(value) && !(real != nullptr && std::isnan(*real))) {
    fields.emplace_back(name, std::visit([](const auto& content) { return Json{content}; }, value));
  }
}

inline Json json_of(const std::vector<std::string>& texts) {
  JsonArray elements;
  for (const std::string& text : texts) elements.push_back(Json{text});
  return Json{std::move(elements)};
}

inline std::vector<std::string> texts_of(const Json& json, const char* name) {
  std::vector<std::string> texts;
  for (const Json& element : json.get<JsonArray>(name)) {
    const auto* text = std::get_if<std::string>(&element.content);
    texts.push_back(text == nullptr ? "" : *text);
  }
  return texts;
}

inline Reading reading_of(const Json& json) {
  Reading reading;
  reading.variable = json.get<std::string>("variable");
  reading.detail = json.get<std::string>("detail");
  reading.source = json.get<std::string>("source");
  const Json* reason = json.find("reason");
  if (reason != nullptr && std::holds_alternative<std::string>(reason->content)) {
    reading.reason = std::get<std::string>(reason->content);
  }
  const Json* value = json.find("value");
  if (json.get<bool>("known") && value == nullptr) {
    reading.value = json.get<std::int64_t>("infinite") > 0 ? infinity : -infinity;
  } else if (json.get<bool>("known")) {
    std::visit(
        [&](const auto& content) {
          if constexpr (std::is_constructible_v<Value, decltype(content)>) reading.value = content;
        },
        value->content);
  }
  reading.evidence_s = json.number("evidence_s");
  reading.start_s = json.number("start_s");
  reading.identified_s = json.number("identified_s");
  reading.expires_s = json.number("expires_s");
  return reading;
}

inline Preview preview_of(const Json& json) {
  Preview preview;
  preview.skill = json.get<std::string>("skill");
  const std::string& outcome = json.get<std::string>("outcome");
  if (outcome == "holds") preview.outcome = Outcome::holds;
  if (outcome == "violated") preview.outcome = Outcome::violated;
  preview.violated = texts_of(json, "violated");
  preview.undecided = texts_of(json, "undecided");
  for (const Json& entry : json.get<JsonArray>("unknown")) {
    preview.unknown.push_back(
        {entry.get<std::string>("variable"), entry.get<std::string>("reason"), entry.get<std::string>("detail")});
  }
  return preview;
}

inline std::string system_error(int number) { return std::generic_category().message(number); }

/// The name of the type of the exception that is handled at present.
inline std::string raised_type() {
  const std::type_info* type = abi::__cxa_current_exception_type();
  if (type == nullptr) return "unknown";
  int status = 0;
  const std::unique_ptr<char, decltype(&std::free)> name(
      abi::__cxa_demangle(type->name(), nullptr, nullptr, &status), std::free);
  return std::string(status == 0 ? name.get() : type->name()).substr(0, 200);
}

/// A callback for readings, and its variables.
struct Callback {
  std::function<void(const Reading&)> function;
  std::vector<std::string> variables;
  std::recursive_mutex mutex;  // held while the function runs
  bool is_over = false;
};

/// The connection to a manager. One thread reads, one renews the lease, and one calls callbacks.
class Connection {
 public:
  static constexpr double response_timeout_s = 5.0;

  explicit Connection(int socket) : socket_(socket) {}
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  ~Connection() { ::close(socket_); }

  /// Sends a request and waits for the answer.
  Json ask(const char* what, JsonObject fields, double wait_s = 0.0, std::shared_ptr<Callback> callback = nullptr) {
    const auto pending = std::make_shared<Pending>();
    pending->callback = std::move(callback);
    std::int64_t id = 0;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (is_over_) throw ConnectionError(end_reason_);
      id = ++last_id_;
      pending_[id] = pending;
    }
    try {
      fields.emplace_back("id", Json{id});
      send(what, std::move(fields));
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex_);
      pending_.erase(id);
      throw;
    }
    const double timeout_s = (wait_s > 0 ? std::min(wait_s, 1e8) : 0.0) + response_timeout_s;
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait_for(lock, std::chrono::duration<double>(timeout_s), [&] { return pending->is_done || is_over_; });
    pending_.erase(id);
    if (!pending->is_done) {
      throw ConnectionError(is_over_ ? end_reason_ : "the manager did not answer within " + seconds_text(timeout_s));
    }
    if (pending->error_kind.empty()) return std::move(pending->answer);
    throw Error(pending->error_kind, pending->error_message);
  }

  /// Sends a request that ends something, without waiting for the answer. A lost connection has ended it already.
  void tell(const char* what, const char* field, std::int64_t number) noexcept {
    try {
      send(what, {{field, Json{number}}});
    } catch (...) {
      return;
    }
  }

  /// Ends the connection; subscribers then get unknown readings.
  void end(const std::string& reason) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (is_over_) return;
    is_over_ = true;
    end_reason_ = reason;
    for (const auto& [number, callback] : callbacks_) {
      for (const std::string& variable : callback->variables) {
        Reading unknown;
        unknown.variable = variable;
        unknown.reason = "unreachable";
        unknown.detail = reason;
        readings_.emplace_back(callback, std::move(unknown));
      }
    }
    ::shutdown(socket_, SHUT_RDWR);
    changed_.notify_all();
  }

  void forget(std::int64_t subscription) {
    const std::lock_guard<std::mutex> lock(mutex_);
    callbacks_.erase(subscription);
  }

  /// Ends the connection of a client that is destroyed: no further callback begins.
  void close() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      callbacks_.clear();
      is_closed_ = true;
    }
    end("the client is closed");
  }

  void read() {
    std::string input;
    std::vector<char> chunk(65536);
    try {
      while (true) {
        const ssize_t size = ::recv(socket_, chunk.data(), chunk.size(), 0);
        if (size < 0 && errno == EINTR) continue;
        if (size < 0) return end("the manager is gone: " + system_error(errno));
        if (size == 0) return end("the manager has closed the connection");
        std::size_t line_end = std::string_view(chunk.data(), static_cast<std::size_t>(size)).find('\n');
        line_end += line_end == std::string_view::npos ? 0 : input.size();
        input.append(chunk.data(), static_cast<std::size_t>(size));
        std::size_t start = 0;
        for (; line_end != std::string::npos; line_end = input.find('\n', start)) {
          handle(JsonParser::parse(std::string_view(input).substr(start, line_end - start)));
          start = line_end + 1;
        }
        input.erase(0, start);
        if (input.size() > max_line_bytes) return end("the manager sent a message that is too long");
      }
    } catch (const std::exception& error) {
      end(error.what());
    }
  }

  void renew_lease(double period_s) {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!changed_.wait_for(lock, std::chrono::duration<double>(period_s), [&] { return is_over_; })) {
      lock.unlock();
      try {
        ask("keep", {});
      } catch (const std::exception& error) {
        end(error.what());
      }
      lock.lock();
    }
  }

  void call_callbacks() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (true) {
      changed_.wait(lock, [&] { return is_over_ || !readings_.empty(); });
      if (is_closed_ || readings_.empty()) return;
      const auto [callback, reading] = std::move(readings_.front());
      readings_.pop_front();
      lock.unlock();
      call(*callback, reading);
      lock.lock();
    }
  }

 private:
  struct Pending {
    bool is_done = false;
    Json answer;
    std::string error_kind, error_message;
    std::shared_ptr<Callback> callback;
  };

  static constexpr std::size_t max_line_bytes = std::size_t{1} << 26;

  static std::string seconds_text(double seconds) {
    std::ostringstream stream;
    stream << seconds << " s";
    return stream.str();
  }

  static void call(Callback& callback, const Reading& reading) {
    const std::lock_guard<std::recursive_mutex> lock(callback.mutex);
    if (callback.is_over) return;
    try {
      callback.function(reading);
    } catch (...) {
      std::cerr << "codra: a callback raised " + raised_type() + "\n";
    }
  }

  void send(const char* what, JsonObject fields) {
    fields.emplace_back("codra", Json{std::int64_t{1}});
    fields.emplace_back("ask", Json{std::string(what)});
    const std::string line = JsonWriter::write(Json{std::move(fields)}) + "\n";
    const std::lock_guard<std::mutex> lock(send_mutex_);
    for (std::size_t sent = 0; sent < line.size();) {
      const ssize_t size = ::send(socket_, line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
      if (size < 0 && errno == EINTR) continue;
      if (size < 0) {
        const std::string reason = "the manager is gone: " + system_error(errno);
        end(reason);
        throw ConnectionError(reason);
      }
      sent += static_cast<std::size_t>(size);
    }
  }

  void handle(const Json& message) {
    if (message.find("notice") != nullptr) return handle_notice(message);
    const Json* id = message.find("id");
    const auto* number = id == nullptr ? nullptr : std::get_if<std::int64_t>(&id->content);
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto entry = number == nullptr ? pending_.end() : pending_.find(*number);
    if (is_over_ || entry == pending_.end()) return;  // no call waits for the answer
    Pending& pending = *entry->second;
    if (const Json* error = message.find("error")) {
      pending.error_kind = error->get<std::string>("kind");
      pending.error_message = error->get<std::string>("message");
    } else {
      pending.answer = Json{message.get<JsonObject>("answer")};
    }
    if (pending.callback != nullptr && pending.error_kind.empty()) {
      callbacks_[pending.answer.get<std::int64_t>("subscription")] = pending.callback;
    }
    pending.is_done = true;
    changed_.notify_all();
  }

  void handle_notice(const Json& message) {
    const std::string& notice = message.get<std::string>("notice");
    if (notice == "lease_over" || notice == "closed") return end(message.get<std::string>("message"));
    if (notice != "reading") return;
    Reading reading = reading_of(Json{message.get<JsonObject>("reading")});
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto entry = callbacks_.find(message.get<std::int64_t>("subscription"));
    if (is_over_ || entry == callbacks_.end()) return;  // the last reading is `unreachable`
    readings_.emplace_back(entry->second, std::move(reading));
    changed_.notify_all();
  }

  const int socket_;
  std::mutex send_mutex_;
  std::mutex mutex_;  // guards all of the following
  std::condition_variable changed_;
  bool is_over_ = false, is_closed_ = false;
  std::string end_reason_;
  std::int64_t last_id_ = 0;
  std::map<std::int64_t, std::shared_ptr<Pending>> pending_;
  std::map<std::int64_t, std::shared_ptr<Callback>> callbacks_;
  std::deque<std::pair<std::shared_ptr<Callback>, Reading>> readings_;
};

/// The threads of a connection, which end with this object.
class Threads {
 public:
  explicit Threads(std::shared_ptr<Connection> connection) : connection_(std::move(connection)) {}
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;

  ~Threads() {
    connection_->close();
    for (std::thread& thread : threads_) {
      // A callback may destroy the client, and cannot wait for its own thread.
      thread.get_id() == std::this_thread::get_id() ? thread.detach() : thread.join();
    }
  }

  /// Starts a thread with a method of the connection and its arguments.
  template <typename Method, typename... Arguments>
  void start(Method method, Arguments... arguments) {
    threads_.emplace_back(method, connection_, arguments...);
  }

 private:
  std::shared_ptr<Connection> connection_;
  std::vector<std::thread> threads_;
};

/// Sends a request when it is destroyed: the end of something that has a number. It can be moved, but not copied.
class Ending {
 public:
  Ending() = default;
  Ending(std::shared_ptr<Connection> connection, const char* ask, const char* field, std::int64_t number)
      : connection_(std::move(connection)), ask_(ask), field_(field), number_(number) {}
  Ending(Ending&& other) noexcept { swap(other); }
  Ending& operator=(Ending&& other) noexcept {
    Ending moved(std::move(other));
    swap(moved);
    return *this;
  }
  ~Ending() {
    if (connection_ != nullptr) connection_->tell(ask_, field_, number_);
  }

  const std::shared_ptr<Connection>& connection() const { return connection_; }
  std::int64_t number() const { return number_; }

 private:
  void swap(Ending& other) noexcept {
    connection_.swap(other.connection_);
    std::swap(ask_, other.ask_);
    std::swap(field_, other.field_);
    std::swap(number_, other.number_);
  }

  std::shared_ptr<Connection> connection_;
  const char *ask_ = "", *field_ = "";
  std::int64_t number_ = 0;
};

inline std::shared_ptr<Connection> connect(const sockaddr* address, socklen_t size, const std::string& shown_address) {
  const int socket = ::socket(address->sa_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (socket < 0) throw ConnectionError("cannot create a socket: " + system_error(errno));
  auto connection = std::make_shared<Connection>(socket);
  const timeval timeout{static_cast<time_t>(Connection::response_timeout_s), 0};
  if (::setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &timeout, sizeof(timeout)) == 0 &&
      ::connect(socket, address, size) == 0) {
    return connection;
  }
  throw ConnectionError("no manager listens at " + shown_address + ": " + system_error(errno));
}

inline std::shared_ptr<Connection> connect(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) throw ConnectionError("the path of the socket is too long: " + path);
  path.copy(address.sun_path, path.size());
  return connect(reinterpret_cast<const sockaddr*>(&address), sizeof(address), path);
}

inline std::shared_ptr<Connection> connect(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return connect(reinterpret_cast<const sockaddr*>(&address), sizeof(address), std::to_string(port));
}

inline std::string read_token(std::uint16_t port) {
  const char* state = std::getenv("XDG_STATE_HOME");
  const char* home = std::getenv("HOME");
  const bool has_state = state != nullptr && *state != '\0';
  const std::string folder = has_state ? state : std::string(home == nullptr ? "" : home) + "/.local/state";
  const std::string path = folder + "/codra/" + std::to_string(port) + ".token";
  std::string token;
  if (!(std::ifstream(path) >> token)) throw ConnectionError("cannot read the token of the manager from " + path);
  return token;
}

}  // namespace detail

/// The part of a skill in progress that acts; it ends when this object is destroyed.
class Acting {
 public:
  Acting() = default;

 private:
  friend class Skill;
  explicit Acting(detail::Ending ending) : ending_(std::move(ending)) {}
  detail::Ending ending_;
};

/// A skill in progress; it ends when this object is destroyed.
class Skill {
 public:
  Skill() = default;

  /// Act: the variables that the skill changes are unknown until there is newer evidence for them.
  Acting act() {
    ending_.connection()->ask("act", {{"number", detail::Json{ending_.number()}}});
    return Acting({ending_.connection(), "acted", "number", ending_.number()});
  }

 private:
  friend class Client;
  explicit Skill(detail::Ending ending) : ending_(std::move(ending)) {}
  detail::Ending ending_;
};

/// A subscription; it ends when this object is destroyed. The destructor waits for a callback that is running, except
/// in the callback itself.
class Subscription {
 public:
  Subscription() = default;
  Subscription(Subscription&&) noexcept = default;
  Subscription& operator=(Subscription&& other) noexcept {
    stop();
    callback_ = std::move(other.callback_);
    ending_ = std::move(other.ending_);
    return *this;
  }
  ~Subscription() { stop(); }

 private:
  friend class Client;
  Subscription(detail::Ending ending, std::shared_ptr<detail::Callback> callback)
      : ending_(std::move(ending)), callback_(std::move(callback)) {}

  void stop() {
    if (callback_ == nullptr) return;
    ending_.connection()->forget(ending_.number());
    const std::lock_guard<std::recursive_mutex> lock(callback_->mutex);
    callback_->is_over = true;
  }

  detail::Ending ending_;
  std::shared_ptr<detail::Callback> callback_;
};

/// A main execution that uses the context manager of another process. Its methods raise `Error` if the manager refuses
/// a request, and `ConnectionError` if there is no connection; a lost connection stays lost: create another client.
///
/// Threads may share a client. What it has declared is withdrawn when it is destroyed, or when its process ends. A
/// child process that the program creates by `fork` must not use it.
class Client {
 public:
  /// Connects to the Unix socket of a manager. The lease is renewed by a thread of the client.
  explicit Client(const std::string& path, double lease_s = 5.0)
      : Client(detail::connect(path), lease_s, std::string()) {}

  /// Connects to a port of 127.0.0.1. By default, the token is read from the token file of the manager.
  explicit Client(std::uint16_t port, double lease_s = 5.0, const std::string& token = "")
      : Client(detail::connect(port), lease_s, token.empty() ? detail::read_token(port) : token) {}

  /// Declares a variable, with the value that the main execution knows, if there is one.
  void declare(const std::string& variable, const Value& value = {}) {
    ask("declare", {{"variable", text(variable)}}, value);
  }

  void withdraw(const std::string& variable) { ask("withdraw", {{"variable", text(variable)}}); }

  /// Announces the skills that come next.
  void expect(const std::vector<std::string>& skills) { ask("expect", {{"skills", detail::json_of(skills)}}); }

  /// Begins a skill: what it previews and monitors is declared until it ends.
  Skill begin(const std::string& skill) {
    const std::int64_t number = ask("begin", {{"skill", text(skill)}}).get<std::int64_t>("number");
    return Skill({connection_, "finish", "number", number});
  }

  Reading get(const std::string& variable) {
    return detail::reading_of(field(ask("get", {{"variable", text(variable)}}), "reading"));
  }

  /// Writes a variable as the main execution, or as an agent. By default, the evidence is of now.
  void set(const std::string& variable, const Value& value, std::optional<double> evidence_s = std::nullopt,
           const std::string& agent = "") {
    detail::JsonObject fields{{"variable", text(variable)}};
    if (evidence_s) detail::add(fields, "evidence_s", *evidence_s);
    if (!agent.empty()) detail::add(fields, "agent", agent);
    ask("set", std::move(fields), value);
  }

  /// Gives a variable a value as the operator for some time; an unknown value makes it unknown.
  void override(const std::string& variable, const Value& value, double for_s, const std::string& reason) {
    detail::JsonObject fields{{"variable", text(variable)}, {"reason", text(reason)}};
    detail::add(fields, "for_s", for_s);
    ask("override", std::move(fields), value);
  }

  void clear_override(const std::string& variable) { ask("clear_override", {{"variable", text(variable)}}); }

  /// Answers a decision from context. If context has no answer, or the connection is lost, `look` finds the value.
  Value decide(const std::string& variable, const std::function<Value()>& look, const Limits& limits = {},
               bool shadow = false) {
    detail::JsonObject fields = fields_of(limits);
    fields.emplace_back("variable", text(variable));
    fields.emplace_back("shadow", detail::Json{shadow});
    detail::Json answer;
    try {
      answer = connection_->ask("decide", std::move(fields), limits.wait_up_to_s);
    } catch (const ConnectionError&) {
      return known_or_unknown(look());
    }
    if (answer.get<bool>("answered")) return detail::reading_of(field(answer, "reading")).value;
    const Value value = found_by(look, answer);
    ask_if_connected("found", found_fields(answer), value);
    return value;
  }

  /// Answers the preview of a skill. With `look`, which gets the name of a variable, unknown variables are looked for.
  Preview preview(const std::string& skill, const std::function<Value(const std::string&)>& look = nullptr,
                  const Limits& limits = {}) {
    detail::JsonObject fields = fields_of(limits);
    fields.emplace_back("skill", text(skill));
    fields.emplace_back("looks", detail::Json{look != nullptr});
    detail::Json answer = connection_->ask("preview", std::move(fields), limits.wait_up_to_s);
    while (!answer.get<bool>("answered")) {
      const std::vector<std::string> variables = detail::texts_of(answer, "look");
      const Value value = found_by([&] { return look(variables.at(0)); }, answer);
      answer = ask("found", found_fields(answer), value);
    }
    return detail::preview_of(field(answer, "preview"));
  }

  /// Calls back with the present readings of some variables, and at each change, in a thread of the client. When the
  /// connection is lost, each variable has an unknown reading with the reason "unreachable".
  [[nodiscard]] Subscription subscribe(const std::vector<std::string>& variables,
                                       std::function<void(const Reading&)> function) {
    const auto callback = std::make_shared<detail::Callback>();
    callback->function = std::move(function);
    callback->variables = variables;
    const detail::Json answer =
        connection_->ask("subscribe", {{"variables", detail::json_of(variables)}}, 0.0, callback);
    return {{connection_, "unsubscribe", "subscription", answer.get<std::int64_t>("subscription")}, callback};
  }

  /// The present instant on the manager's clock.
  double now_s() { return ask("keep", {}).number("now_s").value(); }

 private:
  Client(std::shared_ptr<detail::Connection> connection, double lease_s, const std::string& token)
      : connection_(std::move(connection)), threads_(connection_) {
    threads_.start(&detail::Connection::read);
    detail::JsonObject fields{{"lease_s", detail::Json{lease_s}}};
    if (!token.empty()) detail::add(fields, "token", token);
    ask("hello", std::move(fields));
    threads_.start(&detail::Connection::call_callbacks);
    threads_.start(&detail::Connection::renew_lease, lease_s / 3);
  }

  static detail::Json text(const std::string& text) { return detail::Json{text}; }

  static detail::Json field(const detail::Json& json, const char* name) {
    return detail::Json{json.get<detail::JsonObject>(name)};
  }

  static detail::JsonObject fields_of(const Limits& limits) {
    detail::JsonObject fields;
    if (limits.max_age_s != infinity) detail::add(fields, "max_age_s", limits.max_age_s);
    if (limits.since_s != -infinity) detail::add(fields, "since_s", limits.since_s);
    detail::add(fields, "wait_up_to_s", limits.wait_up_to_s);
    return fields;
  }

  detail::Json ask(const char* what, detail::JsonObject fields, const Value& value = {}) {
    detail::add(fields, "value", value);
    return connection_->ask(what, std::move(fields));
  }

  void ask_if_connected(const char* what, detail::JsonObject fields, const Value& value = {}) {
    try {
      ask(what, std::move(fields), value);
    } catch (const ConnectionError&) {
      return;  // the decision of the program is made already
    }
  }

  /// The value that the program finds by its own look. If the look fails, the manager learns the type of the error.
  Value found_by(const std::function<Value()>& look, const detail::Json& answer) {
    detail::JsonObject fields = found_fields(answer);
    try {
      return known_or_unknown(look());
    } catch (...) {
      detail::add(fields, "raised", detail::raised_type());
      ask_if_connected("found", std::move(fields));
      throw;
    }
  }

  static detail::JsonObject found_fields(const detail::Json& answer) {
    return {{"decision", detail::Json{answer.get<std::int64_t>("decision")}}};
  }

  /// As in a reading, NaN is no value.
  static Value known_or_unknown(Value value) {
    const auto* real = std::get_if<double>(&value);
    return real != nullptr && std::isnan(*real) ? Value() : std::move(value);
  }

  std::shared_ptr<detail::Connection> connection_;
  detail::Threads threads_;
};

}  // namespace codra

#endif  // CODRA_HPP
