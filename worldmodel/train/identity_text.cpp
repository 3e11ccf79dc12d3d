#include "worldmodel/train/identity_text.h"

#include <array>
#include <charconv>
#include <cstdlib>
#include <map>
#include <sstream>
#include <vector>

namespace evac::train {
namespace {

using Parts = std::map<std::string, std::string>;  ///< value by name

/// The numbers that a text begins with, in its order.
constexpr const char* kNumbers[] = {"learning_rate", "decay_from", "beta1",         "beta2",        "epsilon",
                                    "weight_decay",  "clip_norm",  "average_decay", "warmup_steps", "accumulate"};

/// What the words of its last line stand before, and what the user calls that.
const std::map<std::string, const char*> kWords = {{"products", "--products of `evac encode`"},
                                                   {"workers", "--threads that share a step's parts"},
                                                   {"threads", "--threads"},
                                                   {"device", "--device"},
                                                   {"page", "the page of sizes, by hash,"},
                                                   {"forecast", "--forecast, by SHA-256,"},
                                                   {"widened", "--init-widen"},
                                                   {"init", "--init, by SHA-256,"},
                                                   {"except", "--init-except"},
                                                   {"variants", "variants of `evac vary`"}};

constexpr const char *kRecipe = "SHARDS, by recipe,", *kCodec = "the shards' codec, by SHA-256,";

/// As short as a number can be said and read again; other texts, and whole numbers, as they are.
std::string Plain(const std::string& text) {
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || text.find_first_not_of("0123456789") == std::string::npos) return text;
  std::array<char, 40> plain{};
  return std::string(plain.data(), std::to_chars(plain.data(), plain.data() + plain.size(), number).ptr);
}

/// "<recipe> <codec> workers 2 page 3af3…"
void ReadLastLine(const std::string& line, Parts& parts) {
  std::istringstream words(line);
  std::string name;
  for (std::string word; words >> word;) {
    if (const auto known = kWords.find(word); known != kWords.end()) {
      name = known->second;
      if (word == "widened") parts[name] = "given";
      continue;
    }
    if (name.empty()) name = kRecipe;
    else if (name == kRecipe) name = kCodec;
    parts[name] += (parts[name].empty() ? "" : " ") + word;
  }
}

Parts PartsOf(const std::string& identity) {
  Parts parts = {{"optimiser", "adamw"}};
  std::istringstream text(identity);
  std::vector<std::string> words;
  for (std::string word; text >> word && word != "seed";) words.push_back(word);
  for (std::size_t i = 0; i < words.size() && i < std::size(kNumbers); ++i) parts[kNumbers[i]] = Plain(words[i]);
  if (words.size() == std::size(kNumbers) + 2) {
    parts["optimiser"] = words[words.size() - 2];
    parts["momentum"] = Plain(words.back());
  }
  text >> parts["seed"] >> std::ws;
  for (std::string line; std::getline(text, line);) {
    if (text.eof()) {
      ReadLastLine(line, parts);
      break;
    }
    const std::size_t blank = line.find(' ');
    parts[line.substr(0, blank)] = blank == std::string::npos ? "" : Plain(line.substr(blank + 1));
  }
  return parts;
}

}  // namespace

std::string WhatDiffers(const std::string& there, const std::string& here) {
  const Parts before = PartsOf(there), now = PartsOf(here);
  Parts all = before;
  all.insert(now.begin(), now.end());
  std::string text;
  const auto said = [](const Parts& parts, const std::string& name) {
    const auto found = parts.find(name);
    return found == parts.end() || found->second.empty() ? "none" : found->second;
  };
  for (const auto& [name, value] : all) {
    const std::string was = said(before, name), is = said(now, name);
    if (was != is) text += (text.empty() ? "" : "; ") + name + " is " + was + " there, " + is + " here";
  }
  return text;
}

}  // namespace evac::train
