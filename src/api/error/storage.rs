//! Problems of storage.

use axum::http::StatusCode;
use viola_storage::StorageError;

/// Returns the status, the code and the title.
pub(super) fn mapping(error: &StorageError) -> (StatusCode, &'static str, &'static str) {
    use StatusCode as S;
    match error {
        StorageError::TenantFull { .. } => {
            (S::INSUFFICIENT_STORAGE, "tenant_full", "The tenant has no room left")
        }
        StorageError::NoSuchHome => (S::NOT_FOUND, "home_not_found", "There is no such home"),
        StorageError::NoSuchClip => (S::NOT_FOUND, "clip_not_found", "There is no such clip"),
        StorageError::Changed { .. } => {
            (S::PRECONDITION_FAILED, "changed_meanwhile", "It was changed since it was read")
        }
        StorageError::NoSuchWebhook => (S::NOT_FOUND, "webhook_not_found", "There is no such webhook"),
        StorageError::NoSuchDelivery => {
            (S::NOT_FOUND, "delivery_not_found", "The webhook has no such delivery")
        }
        StorageError::NoLidarMap => (S::NOT_FOUND, "lidar_map_not_found", "There is no such LiDAR map"),
        StorageError::TooManyLevels => {
            (S::CONFLICT, "too_many_levels", "The home has as many levels as it may have")
        }
        StorageError::LastLevel => (S::CONFLICT, "last_level", "The home has no other level"),
        StorageError::CursorExpired => (S::GONE, "cursor_expired", "The cursor has expired"),
        // A full disk shows in errors of several kinds.
        error if error.is_full() => (S::INSUFFICIENT_STORAGE, "storage_full", "The service has no room left"),
        _ => (S::INTERNAL_SERVER_ERROR, "internal_error", "The service failed"),
    }
}
