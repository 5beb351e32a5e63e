#include "coordinator/task_table.h"

#include <algorithm>
#include <bit>

#include "coordinator/task_grid.h"

namespace woodcock::coordinator {
namespace {

constexpr int64_t kWord = 64;

bool bit(const std::vector<uint64_t>& bits, int64_t number) {
  const auto word = static_cast<size_t>(number / kWord);
  return word < bits.size() && (bits[word] >> (number % kWord) & 1) != 0;
}

void set_bit(std::vector<uint64_t>& bits, int64_t number, bool value) {
  const auto word = static_cast<size_t>(number / kWord);
  const uint64_t mask = uint64_t{1} << (number % kWord);
  if (word >= bits.size()) {
    if (!value) return;
    bits.resize(word + 1);
  }
  bits[word] = value ? bits[word] | mask : bits[word] & ~mask;
}

/// The first number of [from, to) whose bit is `value`.
std::optional<int64_t> next_bit(const std::vector<uint64_t>& bits, bool value, int64_t from, int64_t to) {
  while (from < to) {
    const auto word = static_cast<size_t>(from / kWord);
    if (word >= bits.size()) return value ? std::nullopt : std::optional(from);
    const uint64_t found = (value ? bits[word] : ~bits[word]) >> (from % kWord);
    if (found != 0) {
      const int64_t number = from + std::countr_zero(found);
      return number < to ? std::optional(number) : std::nullopt;
    }
    from = (from / kWord + 1) * kWord;
  }
  return std::nullopt;
}

}  // namespace

const TaskTable::Section& TaskTable::section_of(int64_t number) const {
  return *std::prev(std::upper_bound(sections_.begin(), sections_.end(), number, [](int64_t n, const Section& s) { return n < s.first; }));
}

TaskArea TaskTable::area(int64_t number) const {
  const Section& section = section_of(number);
  number -= section.first;
  if (const auto* parts = std::get_if<Parts>(&section.tasks)) return parts->areas[static_cast<size_t>(number)];
  if (const auto* grid = std::get_if<Grid>(&section.tasks)) {
    const int64_t tiles = tile_count(grid->bounds, grid->tile_size);
    return {tile_at(grid->bounds, grid->tile_size, number % tiles), bounded_node(grid->round, grid->max_length, number / tiles)};
  }
  const auto& pass = std::get<Pass>(section.tasks);
  const Block& block =
      *std::prev(std::upper_bound(pass.blocks.begin(), pass.blocks.end(), number, [](int64_t n, const Block& b) { return n < b.first; }));
  const PixelRect rect = pass.grid.block(block.index);
  const int64_t tiles = tile_count(rect, pass.tile_size);
  number -= block.first;
  return {tile_at(rect, pass.tile_size, number % tiles), bounded_node(block.range, pass_length(block.range.end), number / tiles)};
}

TaskState TaskTable::state(int64_t number) const {
  if (!bit(settled_, number)) return TaskState::Open;
  if (!bit(undone_, number)) return TaskState::Done;
  return first_parts_.contains(number) ? TaskState::Split : TaskState::GivenUp;
}

int64_t TaskTable::parent(int64_t number) const {
  const auto* parts = std::get_if<Parts>(&section_of(number).tasks);
  return parts ? parts->parent : -1;
}

int64_t TaskTable::append_round(PixelRect bounds, int tile_size, SampleRange round, int64_t max_length) {
  sections_.push_back({size_, Grid{bounds, tile_size, round, max_length}});
  size_ += task_count(bounds, tile_size, round, max_length);
  return bounds.area() * round.size();
}

int64_t TaskTable::append_pass(const SampleMap& before, const std::vector<int64_t>& after, int tile_size) {
  Pass pass{before.grid(), std::min(tile_size, kBlockEdge), {}};
  int64_t tasks = 0, samples = 0;
  for (size_t b = 0; b < pass.grid.size(); ++b) {
    if (after[b] <= before.counts[b]) continue;
    const SampleRange range{before.counts[b], after[b]};
    pass.blocks.push_back({b, tasks, range});
    tasks += task_count(pass.grid.block(b), pass.tile_size, range, pass_length(range.end));
    samples += pass.grid.block(b).area() * range.size();
  }
  if (tasks == 0) return 0;
  sections_.push_back({size_, std::move(pass)});
  size_ += tasks;
  return samples;
}

int64_t TaskTable::split(int64_t number) {
  Parts parts{number, split_task(area(number))};
  const int64_t first = size_;
  size_ += static_cast<int64_t>(parts.areas.size());
  sections_.push_back({first, std::move(parts)});
  first_parts_[number] = first;
  set_bit(settled_, number, true);
  set_bit(undone_, number, true);
  return first;
}

void TaskTable::settle(int64_t number, TaskState state) {
  set_bit(settled_, number, true);
  set_bit(undone_, number, state != TaskState::Done);
}

void TaskTable::reopen(int64_t number) {
  set_bit(settled_, number, false);
  set_bit(undone_, number, false);
}

std::optional<int64_t> TaskTable::next_open(int64_t from, int64_t to) const { return next_bit(settled_, false, from, std::min(to, size_)); }

std::optional<int64_t> TaskTable::next_given_up(int64_t from) const {
  for (auto number = next_bit(undone_, true, from, size_); number; number = next_bit(undone_, true, *number + 1, size_))
    if (!first_parts_.contains(*number)) return number;
  return std::nullopt;
}

}  // namespace woodcock::coordinator
