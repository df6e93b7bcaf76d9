// A program that the tests drive: it reads one line of JSON for each call of the client, and writes what came of it.

#include <atomic>
#include <codra.hpp>
#include <iostream>
#include <memory>
#include <string>
#include <thread>

using codra::detail::Json;
using codra::detail::JsonArray;
using codra::detail::JsonObject;
using codra::detail::JsonParser;
using codra::detail::JsonWriter;

namespace {

std::unique_ptr<codra::Client> client;
std::map<std::int64_t, codra::Skill> skills;
std::map<std::int64_t, codra::Acting> acting;
std::map<std::int64_t, codra::Subscription> subscriptions;

/// As the locales of many languages: a robot's program may use them, and JSON may not.
struct DecimalComma : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

struct LookError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

void print(const JsonObject& fields) {
  static std::mutex mutex;
  const std::string line = JsonWriter::write(Json{fields});
  const std::lock_guard<std::mutex> lock(mutex);
  std::cout << line << std::endl;
}

codra::Value value_of(const Json& call, const char* name = "value") {
  codra::Value value;
  if (call.find("infinite") != nullptr) return codra::infinity * static_cast<double>(call.get<std::int64_t>("infinite"));
  if (call.find("nan") != nullptr) return std::nan("");
  if (const Json* field = call.find(name)) {
    std::visit(
        [&](const auto& content) {
          if constexpr (std::is_constructible_v<codra::Value, decltype(content)>) value = content;
        },
        field->content);
  }
  return value;
}

JsonObject fields_of(const codra::Reading& reading) {
  JsonObject fields{{"variable", Json{reading.variable}}, {"known", Json{reading.known()}}};
  codra::detail::add(fields, "value", reading.value);
  for (const auto& [name, text] : {std::pair{"reason", reading.reason}, {"detail", reading.detail}, {"source", reading.source}}) {
    fields.emplace_back(name, Json{text});
  }
  if (reading.evidence_s) fields.emplace_back("evidence_s", Json{*reading.evidence_s});
  if (reading.expires_s) fields.emplace_back("expires_s", Json{*reading.expires_s});
  return fields;
}

JsonObject fields_of(const codra::Preview& preview) {
  const char* outcomes[] = {"holds", "violated", "unknown"};
  JsonArray unknown;
  for (const codra::UnknownVariable& variable : preview.unknown) {
    unknown.push_back(codra::detail::json_of({variable.variable, variable.reason, variable.detail}));
  }
  return {{"skill", Json{preview.skill}},
          {"outcome", Json{std::string(outcomes[static_cast<int>(preview.outcome)])}},
          {"violated", codra::detail::json_of(preview.violated)},
          {"undecided", codra::detail::json_of(preview.undecided)},
          {"unknown", Json{unknown}}};
}

codra::Limits limits_of(const Json& call) {
  codra::Limits limits;
  limits.max_age_s = call.number("max_age_s").value_or(limits.max_age_s);
  limits.since_s = call.number("since_s").value_or(limits.since_s);
  limits.wait_up_to_s = call.number("wait_up_to_s").value_or(limits.wait_up_to_s);
  return limits;
}

codra::Value look(const Json& call) {
  if (call.find("raise") != nullptr) throw LookError("the camera is off");
  return value_of(call);
}

/// Four threads share a client; a fifth one subscribes and unsubscribes. Prints how many readings they got.
JsonObject crowd(const std::string& path, const std::string& variable, std::int64_t rounds) {
  std::atomic<int> readings{0}, callbacks{0};
  {
    codra::Client shared(path);
    const auto work = [&] {
      for (std::int64_t round = 0; round < rounds; ++round) {
        shared.set(variable, round % 2 == 0);
        readings += shared.get(variable).known() ? 1 : 0;
        codra::Skill skill = shared.begin("drive");
        codra::Acting part = skill.act();
        shared.decide(variable, [] { return true; });
      }
    };
    const auto subscribe = [&] {
      for (std::int64_t round = 0; round < rounds; ++round) {
        const codra::Subscription subscription = shared.subscribe({variable}, [&](const codra::Reading&) { ++callbacks; });
      }
    };
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) threads.emplace_back(work);
    threads.emplace_back(subscribe);
    for (std::thread& thread : threads) thread.join();
  }
  return {{"readings", Json{std::int64_t{readings}}}};
}

JsonObject subscribe(const Json& call) {
  const std::int64_t number = static_cast<std::int64_t>(subscriptions.size());
  const bool raises = call.find("raise") != nullptr;
  subscriptions[number] = client->subscribe(
      codra::detail::texts_of(call, "variables"), [number, raises](const codra::Reading& reading) {
        JsonObject fields = fields_of(reading);
        fields.emplace_back("subscription", Json{number});
        print(fields);
        if (raises) throw LookError("a callback that fails");
      });
  return {};
}

/// Destroys a subscription, or the client itself, in a callback.
JsonObject end_in_callback(const Json& call, bool is_client) {
  static codra::Subscription own;
  std::mutex mutex;
  std::condition_variable ended;
  bool has_ended = false;
  std::unique_lock<std::mutex> lock(mutex);
  own = client->subscribe(codra::detail::texts_of(call, "variables"), [&](const codra::Reading&) {
    const std::lock_guard<std::mutex> callback_lock(mutex);
    own = codra::Subscription();
    if (is_client) client.reset();
    has_ended = true;
    ended.notify_all();
  });
  ended.wait(lock, [&] { return has_ended; });
  return {};
}

JsonObject connect(const Json& call) {
  const double lease_s = call.number("lease_s").value_or(5.0);
  if (call.find("port") == nullptr) {
    client = std::make_unique<codra::Client>(call.get<std::string>("path"), lease_s);
  } else {
    const auto port = static_cast<std::uint16_t>(call.get<std::int64_t>("port"));
    const std::string token = call.find("token") == nullptr ? "" : call.get<std::string>("token");
    client = std::make_unique<codra::Client>(port, lease_s, token);
  }
  return {};
}

JsonObject carry_out(const std::string& what, const Json& call) {
  const auto name = [&] { return call.get<std::string>("name"); };
  const auto number = [&] { return call.get<std::int64_t>("number"); };
  if (what == "connect") return connect(call);
  if (what == "close") return client.reset(), JsonObject();
  if (what == "declare") return client->declare(name(), value_of(call)), JsonObject();
  if (what == "withdraw") return client->withdraw(name()), JsonObject();
  if (what == "expect") return client->expect(codra::detail::texts_of(call, "skills")), JsonObject();
  if (what == "get") return fields_of(client->get(name()));
  if (what == "clear_override") return client->clear_override(name()), JsonObject();
  if (what == "now") return {{"now_s", Json{client->now_s()}}};
  if (what == "crowd") return crowd(call.get<std::string>("path"), name(), number());
  if (what == "subscribe") return subscribe(call);
  if (what == "unsubscribe") return subscriptions.erase(number()), JsonObject();
  if (what == "end_in_callback") return end_in_callback(call, false);
  if (what == "destroy_in_callback") return end_in_callback(call, true);
  if (what == "begin") return skills[number()] = client->begin(name()), JsonObject();
  if (what == "act") return acting[number()] = skills.at(number()).act(), JsonObject();
  if (what == "acted") return acting.erase(number()), JsonObject();
  if (what == "finish") return skills.erase(number()), JsonObject();
  if (what == "override") {
    return client->override(name(), value_of(call), call.number("for_s").value(), call.get<std::string>("reason")),
           JsonObject();
  }
  if (what == "set") {
    const std::string agent = call.find("agent") == nullptr ? "" : call.get<std::string>("agent");
    return client->set(name(), value_of(call), call.number("evidence_s"), agent), JsonObject();
  }
  if (what == "decide") {
    JsonObject fields;
    codra::detail::add(fields, "value", client->decide(name(), [&] { return look(call); }, limits_of(call)));
    return fields;
  }
  if (what == "preview") {
    JsonArray looked;
    const auto look_for = [&](const std::string& variable) {
      looked.push_back(Json{variable});
      return look(call);
    };
    const bool looks = call.find("looks") != nullptr;
    JsonObject fields = fields_of(looks ? client->preview(name(), look_for, limits_of(call))
                                        : client->preview(name(), nullptr, limits_of(call)));
    fields.emplace_back("looked", Json{looked});
    return fields;
  }
  throw std::logic_error("no call " + what);
}

/// Writes each line of JSON again, or `error`.
void echo() {
  for (std::string line; std::getline(std::cin, line);) {
    try {
      std::cout << JsonWriter::write(JsonParser::parse(line)) << std::endl;
    } catch (const codra::Error&) {
      std::cout << "error" << std::endl;
    }
  }
}

}  // namespace

int main(int argc, char**) {
  std::locale::global(std::locale(std::locale(), new DecimalComma));
  if (argc > 1) return echo(), 0;
  for (std::string line; std::getline(std::cin, line);) {
    const Json call = JsonParser::parse(line);
    try {
      print({{"result", Json{carry_out(call.get<std::string>("call"), call)}}});
    } catch (const codra::Error& error) {
      print({{"error", Json{error.kind()}}, {"message", Json{std::string(error.what())}}});
    } catch (const LookError& error) {
      print({{"error", Json{std::string("LookError")}}, {"message", Json{std::string(error.what())}}});
    }
  }
}
