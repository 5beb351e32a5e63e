// The tasks of one frame without a record a task: what a task covers follows from how the frame was cut, and whether it is settled
// takes two bits. A frame of a million tasks is a few hundred kilobytes once they are done, and next to nothing before.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <variant>
#include <vector>

#include "coordinator/model.h"
#include "renderer/film/sample_map.h"

namespace woodcock::coordinator {

/// Tasks are numbered in the order in which they were appended. All numbers that are passed in lie in [0, size()).
class TaskTable {
 public:
  int64_t size() const { return size_; }
  TaskArea area(int64_t number) const;
  /// Open, Done, Split or GivenUp: a task that is being committed is open here.
  TaskState state(int64_t number) const;
  /// The task that it is a part of; -1 for a task of the grid.
  int64_t parent(int64_t number) const;

  /// Appends the tasks of `task_list`. Returns how many samples they have.
  int64_t append_round(PixelRect bounds, int tile_size, SampleRange round, int64_t max_length);
  /// Appends the tasks of `pass_tasks`. Returns how many samples they have.
  int64_t append_pass(const SampleMap& before, const std::vector<int64_t>& after, int tile_size);
  /// Splits an open task (see `split_task`, which must give parts). Returns the number of its first part.
  int64_t split(int64_t number);

  /// Done or GivenUp.
  void settle(int64_t number, TaskState state);
  void reopen(int64_t number);

  /// The first open task of [from, to).
  std::optional<int64_t> next_open(int64_t from, int64_t to) const;
  /// The first task from `from` on that was given up.
  std::optional<int64_t> next_given_up(int64_t from) const;

 private:
  struct Grid {
    PixelRect bounds;
    int tile_size = 0;
    SampleRange round;
    int64_t max_length = 0;
  };
  struct Block {
    size_t index = 0;   ///< in the grid of the frame
    int64_t first = 0;  ///< task of the pass
    SampleRange range;
  };
  struct Pass {
    BlockGrid grid;
    int tile_size = 0;
    std::vector<Block> blocks;
  };
  struct Parts {
    int64_t parent = 0;
    std::vector<TaskArea> areas;
  };
  struct Section {
    int64_t first = 0;
    std::variant<Grid, Pass, Parts> tasks;
  };

  const Section& section_of(int64_t number) const;

  std::vector<Section> sections_;
  int64_t size_ = 0;
  /// One bit a task, as far as any is set: settled; and of these, not done.
  std::vector<uint64_t> settled_, undone_;
  std::map<int64_t, int64_t> first_parts_;  ///< of each split task
};

}  // namespace woodcock::coordinator
