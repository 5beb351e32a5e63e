// Geometry::coincident: what a ray meets at one place, and how well that is known.
#include <algorithm>
#include <cmath>

#include "renderer/geometry/embree_scene.h"

namespace woodcock {

ErrorBound Geometry::Impl::error_bound(const Hit& hit, DVec3 o, DVec3 d) const {
  const DVec3 direction = d;
  to_object(hit.instance, o, d);
  const auto& geometry = shapes[hit.shape].geometry;
  DVec3 n, largest_vertex(0);
  double half_ulp = 0x1p-24;
  const auto add = [&](DVec3 p) { largest_vertex = glm::max(largest_vertex, glm::abs(p)); };
  double edge = 0;  // the distance from the nearest edge
  if (const auto* mesh = std::get_if<Mesh>(&geometry)) {
    const auto& t = mesh->triangles[hit.primitive];
    const DVec3 p0 = mesh->positions[t[0]], p1 = mesh->positions[t[1]], p2 = mesh->positions[t[2]];
    n = glm::cross(p1 - p0, p2 - p0);
    for (const DVec3 p : {p0, p1, p2}) add(p);
    const double b1 = hit.uv.x, b2 = hit.uv.y, longest = std::max({glm::length(p1 - p0), glm::length(p2 - p1), glm::length(p0 - p2)});
    edge = std::min({b1, b2, 1 - b1 - b2}) * glm::length(n) / longest;
  } else if (const auto* patches = std::get_if<PatchMesh>(&geometry)) {
    const auto c = corners(*patches, hit.primitive);
    n = glm::cross(glm::mix(c[1] - c[0], c[3] - c[2], hit.uv.y), glm::mix(c[2] - c[0], c[3] - c[1], hit.uv.x));
    for (const DVec3& p : c) add(p);
    const DVec2 from_edge = glm::min(hit.uv, 1.0 - hit.uv);
    edge = std::min(from_edge.x * std::min(glm::length(c[1] - c[0]), glm::length(c[3] - c[2])),
                    from_edge.y * std::min(glm::length(c[2] - c[0]), glm::length(c[3] - c[1])));
  } else {
    // Given in double, so that only the arithmetic counts.
    const auto& q = std::get<Quadric>(geometry);
    const DVec3 p = o + hit.t * d;
    const DVec3 on = transform_point(q.object_from_render, p);
    n = transform_normal(q.object_from_render, outward(q, on));
    edge = edge_distance(q, on) * glm::length(d) / glm::length(transform_vector(q.object_from_render, d));
    half_ulp = 0;
  }
  // The arithmetic in double is off by some units in the last place of the way.
  const double arithmetic = 0x1p-47 * (glm::length(o) + hit.t * glm::length(d));
  const double distance = glm::dot(glm::abs(n), largest_vertex) * half_ulp / glm::length(n) + arithmetic;
  const double slant = std::abs(glm::dot(n, d)) / (glm::length(n) * glm::length(d));
  const double lateral = kEmbreeError * hit.t * glm::length(d) + kCoincidence * glm::length(largest_vertex) * half_ulp;
  if (hit.instance < 0) return {distance, slant, edge * slant <= lateral};
  // Seen along the ray the error is the same in both spaces. Embree takes the ray to the object in float, which adds
  // some units in the last place.
  const double along = distance * glm::length(n) / std::abs(glm::dot(n, d));
  const DVec3 placed = glm::normalize(transform_normal(object_from_render[hit.instance], n));
  const double cosine = std::abs(glm::dot(placed, direction)) / glm::length(direction);
  const DVec3 p = transform_point(instances[hit.instance].render_from_object, o + hit.t * d);
  // Nor does a ray start nearer to the place that it left at an edge (CoincidentHits::origin).
  const double moved = kCoincidence * 0x1p-23 * glm::length(p) * glm::length(d) / glm::length(direction);
  return {along * cosine * glm::length(direction) + glm::dot(glm::abs(placed), glm::abs(p)) * 0x1p-23, cosine,
          edge * slant <= lateral + moved};
}

bool Geometry::is_at_edge(const Ray& ray, const Hit& hit) const { return impl_->error_bound(hit, ray.o, ray.d).at_edge; }

double Gathering::reach(const ErrorBound& other) const {
  // Along the steeper normal: of surfaces that cross at an angle the flatter one's t says little.
  return kCoincidence * (other.distance + at.error.distance) / std::max({other.cosine, at.error.cosine, 1e-9});
}

void Gathering::offer(const Query& query, int shape, uint32_t primitive, int instance) {
  const Geometry::Impl& impl = *query.impl;
  for (size_t i = 0; i < std::min(count, found.size()); ++i) {
    const Hit& known = found[i].hit;
    if (known.shape == shape && known.primitive == primitive && known.instance == instance) return;
  }
  DVec3 o = query.o, d = query.d;
  impl.to_object(instance, o, d);
  const auto exact = impl.intersect_primitive(shape, primitive, o, d, std::max(query.skip, t0), t1);
  if (!exact || !(exact->t > query.skip)) return;
  Hit hit{exact->t, exact->uv, shape, primitive, instance};
  impl.keep_inside(hit, o, d);
  const ErrorBound error = impl.error_bound(hit, query.o, query.d);
  // A hit that was put back onto an edge lies beside the ray by as much as Embree misjudges; its plane tells the place. Of a plane that
  // the ray grazes it is the other way round.
  const double apart = std::min(std::abs(exact->t - plane_t), std::abs(hit.t - at.hit.t));
  if (apart > reach(error)) return;
  if (count < found.size()) found[count] = {hit, error};
  ++count;
}

size_t Geometry::coincident(const Ray& ray, const Hit& hit, std::span<CoincidentHit> found) const {
  Query query(*impl_, ray, kInf);
  Gathering gathering;
  gathering.at = {hit, impl_->error_bound(hit, query.o, query.d)};
  gathering.plane_t = hit.t;
  // Only what was put back onto an edge has another place than its plane; of patches and quadrics nothing is put back.
  if (gathering.at.error.at_edge && impl_->is_flat(hit.shape)) {
    DVec3 o = query.o, d = query.d;
    impl_->to_object(hit.instance, o, d);
    if (const auto plane = impl_->intersect_primitive(hit.shape, hit.primitive, o, d, query.skip, kInf)) gathering.plane_t = plane->t;
  }
  gathering.found = found;
  gathering.count = 1;
  found[0] = gathering.at;
  // No primitive's error is larger than that of `worst`.
  const ErrorBound worst{2 * 0x1p-23 * impl_->largest, 0};
  const double reach = gathering.reach(worst);
  gathering.t0 = hit.t - reach;
  gathering.t1 = hit.t + reach;
  query.gathering = &gathering;
  RTCRay r = embree_ray(query, hit.t - 2 * reach, hit.t + 2 * reach);
  rtcOccluded1(impl_->scene, &query.context, &r);
  return gathering.count;
}

}  // namespace woodcock
