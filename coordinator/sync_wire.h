// Sync's messages ↔ the scheduler's types. From the wire everything is checked: RpcError INVALID_ARGUMENT, FAILED_PRECONDITION
// (protocol) or RESOURCE_EXHAUSTED (lists too long).
#pragma once

#include "coordinator/scheduler.h"
#include "woodcock/v1/workers_service.pb.h"

namespace woodcock::coordinator {

WorkerReport report_from_wire(const v1::SyncRequest& request);
std::vector<Offer> offers_from_wire(const v1::SyncRequest& request);
v1::LeaseGrant grant_to_wire(const Grant& grant, const Job& job, Time lease);
v1::OfferVerdict verdict_to_wire(const Offer& offer, OfferStatus status, const std::string& reason);

}  // namespace woodcock::coordinator
