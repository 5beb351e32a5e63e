// The render child's work: tasks by FrameRenderer, with the last worlds kept.
#pragma once

#include <atomic>
#include <list>
#include <memory>
#include <optional>
#include <string>

#include "renderer/frame/frame_renderer.h"
#include "worker/render_child.h"

namespace woodcock {

/// Keeps up to kWorlds compiled frames, most recently used first: the tasks of one frame come one after the other, and
/// those of two jobs alternate.
class FrameTaskRenderer : public TaskRenderer {
 public:
  static constexpr size_t kWorlds = 2;

  void begin() override;
  std::optional<RenderedTile> render(const RenderCommand& command) override;
  void cancel() override { progress_->cancel = true; }
  ChildProgress progress() const override;
  std::string render_build() const override { return woodcock::render_build(); }
  std::string arithmetic_class() const override { return woodcock::arithmetic_class(); }

 private:
  struct Kept {
    std::string key;
    std::optional<FrameRenderer> renderer;
  };
  /// Throws SceneError and std::invalid_argument.
  const FrameRenderer& renderer_for(const RenderCommand& command, bool& reused);

  std::list<Kept> worlds_;  // only the rendering thread
  std::unique_ptr<RenderProgress> progress_ = std::make_unique<RenderProgress>();
  std::atomic<const char*> phase_{"idle"};
};

}  // namespace woodcock
